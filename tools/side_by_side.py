#!/usr/bin/env python3
"""The desk in close-up with as many bytes of lightmap: uniform density, texels where the light needs them, path-traced.

  target/charts-venv/bin/pip install -r tools/charts-requirements.txt
  cargo build --release
  target/charts-venv/bin/python tools/side_by_side.py     # writes fixtures/desk/same-bytes.png

Bakes with `--density light --size N` and searches the page of `--density uniform` whose EXR has as many bytes. The
pictures are what a viewer shows: the ray through each sample meets a triangle, the EXR is looked up bilinearly at its
TEXCOORD_1, times the reflectance over pi. The last column is Mitsuba's path tracing of the same views (--spp 0 leaves it
out). All share one exposure and tone curve. The loader knows what the desk has: no textures, no punctual lights.
"""

import argparse
import json
import struct
import subprocess
import tempfile
from pathlib import Path

import matplotlib
import numpy as np
import OpenEXR
from PIL import Image, ImageDraw, ImageFont

ROOT = Path(__file__).resolve().parent.parent
FONT = Path(matplotlib.get_data_path()) / "fonts" / "ttf" / "DejaVuSans.ttf"
DESK = ROOT / "fixtures" / "desk"

# Eye, what it looks at, width of the view in degrees, height of the picture over its width: metres, y up.
VIEWS = (
    ((0.02, 1.30, 0.95), (-0.11, 0.75, 0.135), 43.0, 0.62),
    ((0.19, 0.98, 0.42), (0.10, 0.75, 0.165), 34.0, 0.62),
    ((-0.36, 1.04, 0.66), (-0.415, 0.77, 0.27), 32.0, 0.62),
)
PANEL, GAP, HEAD = 396, 6, 44
SAMPLES = 3  # a pixel's side
PASS = 16  # paths a pixel that are traced at once
LARGEST_REFLECTANCE = 0.95


class Model:
    """World-space triangles of a GLB with their materials and, where it is baked, their lightmap."""

    def __init__(self, path):
        data = Path(path).read_bytes()
        (length,) = struct.unpack_from("<I", data, 12)
        self.json, self.binary = json.loads(data[20 : 20 + length]), data[28 + length :]
        corners, charts, self.material_of = [], [], []
        scene = self.json["scenes"][self.json.get("scene", 0)]
        stack = [(node, np.eye(4)) for node in scene["nodes"]]
        while stack:
            index, above = stack.pop()
            node = self.json["nodes"][index]
            world = above @ local_matrix(node)
            stack += [(child, world) for child in node.get("children", ())]
            for primitive in self.json["meshes"][node["mesh"]]["primitives"] if "mesh" in node else ():
                triangles = self.accessor(primitive["indices"]).reshape(-1, 3)
                points = self.accessor(primitive["attributes"]["POSITION"]).astype(float)
                corners.append((points @ world[:3, :3].T + world[:3, 3])[triangles])
                uv = primitive["attributes"].get("TEXCOORD_1")
                charts.append(np.zeros((len(triangles), 3, 2)) if uv is None else self.accessor(uv)[triangles])
                self.material_of += [primitive["material"]] * len(triangles)
        self.corners, self.charts = np.concatenate(corners), np.concatenate(charts)
        self.material_of = np.array(self.material_of)
        materials = self.json["materials"]
        self.reflectance = np.array([reflectance(material) for material in materials])
        self.emission = np.array([emission(material) for material in materials])
        self.two_sided = np.array([material.get("doubleSided", False) for material in materials])
        self.page = self.read_page()

    def view(self, index):
        view = self.json["bufferViews"][index]
        start = view.get("byteOffset", 0)
        return self.binary[start : start + view["byteLength"]], view.get("byteStride")

    def accessor(self, index):
        accessor = self.json["accessors"][index]
        kind = {5121: "u1", 5123: "<u2", 5125: "<u4", 5126: "<f4"}[accessor["componentType"]]
        width = {"SCALAR": 1, "VEC2": 2, "VEC3": 3}[accessor["type"]]
        data, stride = self.view(accessor["bufferView"])
        item = np.dtype(kind).itemsize
        shape, strides = (accessor["count"], width), (stride or item * width, item)
        return np.ndarray(shape, kind, data, accessor.get("byteOffset", 0), strides)

    def read_page(self):
        baked = self.json.get("extensions", {}).get("COBAKE_lightmap")
        if not baked:
            return None
        assert baked["lightmaps"][0]["quantity"] == "irradiance"
        data, _ = self.view(baked["lightmaps"][0]["bufferView"])
        with tempfile.NamedTemporaryFile(suffix=".exr") as file:
            file.write(data)
            file.flush()
            with OpenEXR.File(file.name) as exr:
                return exr.channels()["RGB"].pixels.astype(float)


def local_matrix(node):
    if "matrix" in node:
        return np.array(node["matrix"]).reshape(4, 4).T
    x, y, z, w = node.get("rotation", (0, 0, 0, 1))
    matrix = np.eye(4)
    matrix[:3, :3] = np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]) * node.get("scale", (1, 1, 1))  # fmt: skip
    matrix[:3, 3] = node.get("translation", (0, 0, 0))
    return matrix


def reflectance(material):
    surface = material.get("pbrMetallicRoughness", {})
    colour = np.array(surface.get("baseColorFactor", (1, 1, 1, 1))[:3])
    return np.minimum(colour * (1 - surface.get("metallicFactor", 1)), LARGEST_REFLECTANCE)


def emission(material):
    strength = material.get("extensions", {}).get("KHR_materials_emissive_strength", {}).get("emissiveStrength", 1)
    return np.array(material.get("emissiveFactor", (0, 0, 0))) * strength


def camera(view):
    """The eye, and the axes right, up and forward."""
    eye, target = np.array(view[0]), np.array(view[1])
    forward = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(forward, (0, 1, 0))
    right /= np.linalg.norm(right)
    return eye, np.stack([right, np.cross(right, forward), forward])


def nearest(corners, view, size):
    """The triangle that each sample's ray meets first, and the barycentric coordinates there (Möller, Trumbore)."""
    eye, axes = camera(view)
    width, height = size
    step = 2 * np.tan(np.radians(view[2]) / 2) / width
    x = (np.arange(width) + 0.5 - width / 2) * step
    y = (height / 2 - np.arange(height) - 0.5) * step
    directions = axes[2] + x[None, :, None] * axes[0] + y[:, None, None] * axes[1]
    found, distance = np.full((height, width), -1), np.full((height, width), np.inf)
    weights = np.zeros((height, width, 2))
    for index, (a, b, c) in enumerate(corners):
        # Only rays in the rectangle that the triangle fills in the picture can meet it.
        seen = (np.stack([a, b, c]) - eye) @ axes.T
        window = np.s_[:, :]
        if (seen[:, 2] > 1e-3).all():
            columns = seen[:, 0] / seen[:, 2] / step + width / 2
            rows = height / 2 - seen[:, 1] / seen[:, 2] / step
            left, top = max(int(columns.min()) - 1, 0), max(int(rows.min()) - 1, 0)
            window = np.s_[top : max(int(rows.max()) + 2, 0), left : max(int(columns.max()) + 2, 0)]
        elif (seen[:, 2] <= 0).all():
            continue
        d = directions[window]
        p = np.cross(d, c - a)
        with np.errstate(divide="ignore", invalid="ignore"):
            inverse = 1 / (p @ (b - a))
            u = p @ (eye - a) * inverse
            q = np.cross(eye - a, b - a)
            v = d @ q * inverse
            t = (c - a) @ q * inverse
            better = (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0) & (t < distance[window])
        found[window][better], distance[window][better] = index, t[better]
        weights[window][better] = np.stack([u, v], -1)[better]
    return found.ravel(), weights.reshape(-1, 2)


def bilinear(page, uv):
    height, width = page.shape[:2]
    at = np.clip(uv * [width, height] - 0.5, 0, [width - 1, height - 1])
    low = np.floor(at).astype(int)
    x, y = low.T
    right, below = np.minimum(x + 1, width - 1), np.minimum(y + 1, height - 1)
    f, g = (at - low).T[..., None]
    return (page[y, x] * (1 - f) + page[y, right] * f) * (1 - g) + (page[below, x] * (1 - f) + page[below, right] * f) * g


def lit(model, view, size):
    """What a viewer shows of a baked model: radiance, samples averaged to pixels."""
    fine = (size[0] * SAMPLES, size[1] * SAMPLES)
    triangle, weights = nearest(model.corners, view, fine)
    a, b, c = np.moveaxis(model.charts[triangle], 1, 0)
    u, v = weights.T[..., None]
    material = model.material_of[triangle]
    irradiance = bilinear(model.page, a * (1 - u - v) + b * u + c * v)
    radiance = model.emission[material] + model.reflectance[material] * irradiance / np.pi
    radiance[triangle < 0] = 0
    return radiance.reshape(size[1], SAMPLES, size[0], SAMPLES, 3).mean((1, 3))


def traced(model, view, size, spp):
    """The same by Mitsuba's path tracer, whose emitters and materials are those of cobake."""
    import mitsuba as mi

    mi.set_variant("llvm_ad_rgb", "scalar_rgb")
    eye, target, angle, _ = view
    scene = {"type": "scene", "integrator": {"type": "path", "max_depth": -1}}
    for index in np.unique(model.material_of):
        colour = {"type": "rgb", "value": list(model.reflectance[index])}
        surface = {"type": "diffuse", "reflectance": colour}
        properties = mi.Properties()
        properties["bsdf"] = mi.load_dict({"type": "twosided", "bsdf": surface} if model.two_sided[index] else surface)
        if model.emission[index].any():
            shine = {"type": "rgb", "value": list(model.emission[index])}
            properties["emitter"] = mi.load_dict({"type": "area", "radiance": shine})
        corners = model.corners[model.material_of == index].reshape(-1, 3).astype(np.float32)
        mesh = mi.Mesh(f"m{index}", len(corners), len(corners) // 3, props=properties)
        arrays = mi.traverse(mesh)
        arrays["vertex_positions"] = corners.ravel()
        arrays["faces"] = np.arange(len(corners), dtype=np.uint32)
        arrays.update()
        scene[f"m{index}"] = mesh
    scene["sensor"] = {
        "type": "perspective", "fov": angle, "fov_axis": "x", "near_clip": 0.01,
        "to_world": mi.ScalarTransform4f().look_at(list(eye), list(target), [0, 1, 0]),
        "film": {"type": "hdrfilm", "width": size[0], "height": size[1], "rfilter": {"type": "box"}},
        "sampler": {"type": "independent", "sample_count": PASS},
    }  # fmt: skip
    scene, passes = mi.load_dict(scene), max(spp // PASS, 1)
    return sum(np.array(mi.render(scene, seed=seed), float)[..., :3] for seed in range(passes)) / passes


def tone_mapped(radiance, exposure):
    """Reinhard et al. 2002, equation 4, as src/picture/tone.rs has it; then sRGB."""
    value = np.maximum(radiance, 0) * exposure
    luminance = value @ [0.2126, 0.7152, 0.0722]
    value *= ((1 + luminance / 16) / (1 + luminance))[..., None]
    value = np.clip(value, 0, 1)
    encoded = np.where(value <= 0.0031308, 12.92 * value, 1.055 * value ** (1 / 2.4) - 0.055)
    return (255 * encoded + 0.5).astype(np.uint8)


def bake(cobake, folder, density, size):
    """A baked model, its bytes of EXR and its error near contacts in strong light."""
    baked, report = folder / "baked.glb", folder / "report.json"
    options = ["--density", density, "--size", str(size), "--report", report, "--quiet"]
    subprocess.run([cobake, "bake", DESK / "scene.glb", "-o", baked, *options], check=True)
    compare = [cobake, "compare", baked, "--reference", DESK / "reference.npz", "--json"]
    figures = json.loads(subprocess.run(compare, check=True, capture_output=True, text=True).stdout)
    size_in_bytes = json.loads(report.read_text())["lightmap"]["bytes"]
    print(f"--density {density} --size {size}: {size_in_bytes} bytes", flush=True)
    return Model(baked), size_in_bytes, figures["detail"]["rrmse_corr"]


def uniform_of(cobake, folder, size, wanted):
    """The uniform bake whose bytes come nearest to `wanted`: bytes grow about with the page's texels."""
    tried = {}
    while size not in tried:
        tried[size] = bake(cobake, folder, "uniform", size)
        size = round(size * (wanted / tried[size][1]) ** 0.5)
    best = min(tried, key=lambda side: abs(tried[side][1] - wanted))
    return best, tried[best]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cobake", default=str(ROOT / "target" / "release" / "cobake"), metavar="PROGRAM")
    parser.add_argument("--size", type=int, default=362, help="side of the page of --density light [default: 362]")
    parser.add_argument("--spp", type=int, default=1024, help="paths a pixel of the last column [default: 1024]")
    parser.add_argument("--output", type=Path, default=DESK / "same-bytes.png", metavar="FILE.png")
    args = parser.parse_args()

    with tempfile.TemporaryDirectory() as folder:
        ours = bake(args.cobake, Path(folder), "light", args.size)
        side, uniform = uniform_of(args.cobake, Path(folder), args.size, ours[1])

    def label(name, size, baked):
        return name, f"{size} × {size} texels, {baked[1] / 1000:,.0f} kB, error {100 * baked[2]:.1f} %"

    columns = [
        (label("--density uniform", side, uniform), lambda view, size: lit(uniform[0], view, size)),
        (label("--density light", args.size, ours), lambda view, size: lit(ours[0], view, size)),
    ]
    if args.spp:
        source = Model(DESK / "scene.glb")
        columns.append((("path-traced", "Mitsuba 3"), lambda view, size: traced(source, view, size, args.spp)))

    sizes = [(PANEL, round(PANEL * view[3])) for view in VIEWS]
    height = HEAD + sum(size[1] for size in sizes) + GAP * (len(VIEWS) - 1)
    sheet = Image.new("RGB", (len(columns) * (PANEL + GAP) - GAP, height), "white")
    draw = ImageDraw.Draw(sheet)
    for x, ((name, about), _) in enumerate(columns):
        left = x * (PANEL + GAP)
        draw.text((left + 4, 2), name, "#202024", ImageFont.truetype(FONT, 16))
        draw.text((left + 4, 23), about, "#606068", ImageFont.truetype(FONT, 13))
    top = HEAD
    for view, size in zip(VIEWS, sizes):
        shown = [render(view, size) for _, render in columns]
        exposure = 1.6 / np.percentile(shown[-1] @ [0.2126, 0.7152, 0.0722], 95)
        for x, radiance in enumerate(shown):
            sheet.paste(Image.fromarray(tone_mapped(radiance, exposure)), (x * (PANEL + GAP), top))
        top += size[1] + GAP
    sheet.save(args.output, optimize=True)
    print(f"{args.output}: {args.output.stat().st_size} bytes")


if __name__ == "__main__":
    main()
