#!/usr/bin/env python3
"""What an atlas's own resolution allows: exact irradiance at its texels, looked up as a lightmap is.

  python3 tools/atlas_limit.py --measure DIR BAKED.glb REFERENCE.npz [--spp N]

For each reference point the four texels that a bilinear lookup touches are found, each at the nearest place inside its
chart; what Mitsuba's path tracing (N paths a texel) finds there is interpolated as the lookup does it. Texels inside of
solids, where a tenth of the rays meets backs and next to no light comes, leave their weight to the others. The figures are `rrmse_corr` of
`cobake compare`, the texels' own noise removed as the reference's is.

DIR holds the reference renderer, `mtsref.py`, and its glTF reader, `lmcommon.py` and `evaluate.py`, with Mitsuba 3.9.
"""

import argparse
import sys
from pathlib import Path

import numpy as np

INSIDE = 0.1
DARK = 0.01
SETS = ("uniform", "contact", "detail")


def touched_texels(uv, side):
    """The four texels of each lookup, as (n, 4) columns and rows, and their weights."""
    width, height = side
    at = np.clip(uv * [width, height] - 0.5, 0, [width - 1, height - 1])
    low = np.floor(at).astype(int)
    high = np.minimum(low + 1, [width - 1, height - 1])
    f = at - low
    columns = np.stack([low[:, 0], high[:, 0], low[:, 0], high[:, 0]], 1)
    rows = np.stack([low[:, 1], low[:, 1], high[:, 1], high[:, 1]], 1)
    x, y = f[:, 0], f[:, 1]
    weights = np.stack([(1 - x) * (1 - y), x * (1 - y), (1 - x) * y, x * y], 1)
    return columns, rows, weights


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--measure", type=Path, required=True)
    parser.add_argument("baked")
    parser.add_argument("reference")
    parser.add_argument("--spp", type=int, default=1024)
    args = parser.parse_args()
    sys.path.insert(0, str(args.measure))
    import evaluate
    import lmcommon
    import mtsref

    scene = lmcommon.load_scene(args.baked)
    soup = lmcommon.soup(scene)
    reference = evaluate.load_ref(args.reference)
    # Triangles without area have no normal to gather about.
    crosses = np.cross(soup.T[:, 1] - soup.T[:, 0], soup.T[:, 2] - soup.T[:, 0])
    charted = soup.uv1.copy()
    charted[np.linalg.norm(crosses, axis=1) < 1e-12 * scene.size() ** 2] = np.nan
    images, which, _ = evaluate.ADAPTERS["ext"](args.baked, scene)
    height, width = images[0].shape[:2]
    triangle, bary, _ = evaluate.locate(soup, reference["P"], reference["N"], 1e-3 * scene.size())
    found = np.nonzero(triangle >= 0)[0]
    uv = np.einsum("nk,nkc->nc", bary[found], soup.uv1[triangle[found]])
    known = np.isfinite(uv).all(1) & (np.array(which)[soup.prim[triangle[found]]] == 0)
    found, uv = found[known], uv[known]
    columns, rows, weights = touched_texels(uv, (width, height))

    soup.uv1 = charted
    texel_triangle, texel_bary, _ = lmcommon.raster(soup, width, height, 1.5)
    texels, index = np.unique(rows * width + columns, return_inverse=True)
    index = index.reshape(columns.shape)
    ys, xs = texels // width, texels % width
    of = texel_triangle[ys, xs]
    b = texel_bary[ys, xs] * 0.998 + 0.002 / 3
    at = np.einsum("nk,nkc->nc", b, soup.T[of])
    tracer = mtsref.MScene(args.baked)
    halves, back = [], 0
    for seed in (1, 2):
        total, _, hits = mtsref.irradiance(tracer, at, soup.N[of], args.spp // 2, seed=seed, want_hits=True)
        halves.append(total)
        back = back + 0.5 * hits["back"]

    is_dark = 0.5 * (halves[0] + halves[1]).mean(1) < DARK * reference["E"].mean()
    weights = weights * ((of >= 0) & ~((back >= INSIDE) & is_dark))[index]
    some = weights.sum(1) > 0
    found, index, weights = found[some], index[some], weights[some] / weights[some].sum(1, keepdims=True)
    first, second = (np.einsum("nk,nkc->nc", weights, half[index]) for half in halves)
    own_error = 0.5 * np.abs(first - second)
    exact = 0.5 * (first + second)
    baked = evaluate.sample_baked(args.baked, reference, adapter="ext")
    print(f"{args.baked}: {width} x {height}, {len(texels)} texels")
    for number, name in enumerate(SETS):
        q = (reference["set"][found] == number) & ~reference["buried"][found] & np.isfinite(baked[found]).all(1)
        points = found[q]
        error = np.sqrt(reference["E_se"][points] ** 2 + own_error[q] ** 2)
        limit = evaluate.metrics(exact[q], reference["E"][points], error)["rrmse_corr"]
        ours = evaluate.metrics(baked[points], reference["E"][points], reference["E_se"][points])["rrmse_corr"]
        print(f"  {name}: the atlas allows {100 * limit:.2f} %, baked {100 * ours:.2f} %, ratio {ours / limit:.2f}")


if __name__ == "__main__":
    main()
