#!/usr/bin/env python3
"""Accuracy against time, bytes, elements, and a blocker's height: bakes, measures, draws tools/charts/*.

  python3 -m venv target/charts-venv
  target/charts-venv/bin/pip install -r tools/charts-requirements.txt
  cargo build --release
  target/charts-venv/bin/python tools/charts.py            # all that the fixtures allow
  target/charts-venv/bin/python tools/charts.py --redraw   # draws from tools/charts/results.json, bakes nothing

Parts, to be named with --only: cornell, desk, office (error against CPU seconds), bytes (error against bytes with
either --density, and the table of equal error), elements (error against elements on the desk, and the table of equal
elements), blocker. Only cornell and desk are fixtures: --scenes DIR and --reference DIR say where the others lie, as
NAME.glb or the one .glb in NAME/, and NAME.ref.npz or NAME/reference.npz; old rows of what is not there stay.

Errors are `rrmse_corr` of `cobake compare`; seconds are the CPU seconds of the whole program, from its report.
"""

import argparse
import json
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

import blocker
import charts_draw

TOOLS = Path(__file__).resolve().parent
ROOT = TOOLS.parent
CHARTS = TOOLS / "charts"
RESULTS = CHARTS / "results.json"
FIXTURES = ROOT / "fixtures"

PARTS = ("cornell", "desk", "office", "bytes", "elements", "blocker")
GATHER_ERRORS = (0.05, 0.02, 0.007, 0.003, 0.0015)
POLICIES = ("cob", "gradient", "cob+gradient", "uniform")

# Sweeps of error against elements: thresholds in metres. The uniform mesh grows with their inverse square.
THRESHOLDS = {
    "cob": (0.25, 0.128, 0.064, 0.032, 0.016, 0.008, 0.004, 0.002),
    "gradient": (0.5, 0.25, 0.128, 0.064, 0.032, 0.016, 0.008, 0.004),
    "cob+gradient": (0.5, 0.25, 0.128, 0.064, 0.032, 0.016, 0.008, 0.004),
    "uniform": (0.5, 0.3, 0.2, 0.1, 0.05, 0.03, 0.02),
}

# Pages of the sweep of error against bytes; the uniform density's go on to twice the last one's side.
BYTES_SIZES = {
    "cornell": (64, 96, 128, 181, 256, 362, 512, 724),
    "desk": (128, 181, 256, 362, 512, 724, 1024),
    "office": (362, 512, 724, 1024),
    "white-room": (128, 181, 256, 362, 512, 724, 1024),
    "godot-living-room": (128, 181, 256, 362, 512, 724, 1024),
}
SETS = ("uniform", "contact", "detail")

BLOCKER_SIDES = (0.2, 0.03)
BLOCKER_HEIGHTS = (0.001, 0.003, 0.01, 0.03, 0.1, 0.3, 0.6, 0.9)
BLOCKER_METHODS = [("none", 1.0), ("gradient", 1.0), ("cob+gradient", 1.0)] + [
    ("cob", fraction) for fraction in (0.1, 0.3, 1.0, 3.0, 10.0)
]


class Bench:
    """Bakes a scene and measures the result; rows that `kept` has are not baked again."""

    def __init__(self, args, folder, kept):
        self.args, self.folder = args, Path(folder)
        self.kept = {(row["part"], row["scene"], row["options"]): row for row in kept}
        self.rows = list(kept)
        words = [args.cobake, "compare", "--help"]
        self.compares = subprocess.run(words, capture_output=True).returncode == 0
        if not self.compares and not args.evaluate:
            raise SystemExit(f"{args.cobake} has no `compare`; build a newer one, or name an evaluator with --evaluate")

    def measure(self, part, scene, path, reference, options, **about):
        """Adds a row; `about` is what the chart needs to know besides the figures."""
        if (part, scene, options) in self.kept:
            return
        baked, report = self.folder / "baked.glb", self.folder / "report.json"
        bake = [self.args.cobake, "bake", path, "-o", baked, "--report", report, "--quiet", *options.split()]
        subprocess.run(bake, check=True)
        said = json.loads(report.read_text())
        if self.compares:
            evaluate = [self.args.cobake, "compare", baked, "--reference", reference, "--json"]
        else:
            evaluate = [sys.executable, self.args.evaluate, baked, reference, "--adapter", "ext", "--json"]
        figures = json.loads(subprocess.run(evaluate, check=True, capture_output=True, text=True).stdout)
        row = {
            "part": part,
            "scene": scene,
            "options": options,
            **about,
            "cpu_seconds": round(said["time"]["total_cpu_seconds"], 3),
            "elements": said["elements"]["final"],
            "texels": said["lightmap"]["width"] * said["lightmap"]["height"],
            "bytes": said["lightmap"]["bytes"],
            "glb_bytes": baked.stat().st_size,
            "unmatched": figures["unmatched"],
        }
        for name in SETS:
            if name in figures:
                row[name] = round(figures[name]["rrmse_corr"], 5)
        self.rows.append(row)
        errors = " / ".join(f"{100 * row[name]:.2f}" for name in SETS if name in row)
        print(f"{scene:17} {options:75} {row['cpu_seconds']:7.2f} s {row['elements']:8} elements {row['bytes']:9} bytes  "
              f"{errors} %", flush=True)  # fmt: skip
        save(self.rows)


def save(rows):
    CHARTS.mkdir(exist_ok=True)
    order = {part: i for i, part in enumerate(PARTS)}
    lines = [json.dumps(row) for row in sorted(rows, key=lambda row: order[row["part"]])]
    tables = {"bakes": lines}
    tables["equal_elements"] = [json.dumps(row) for row in equal_elements(rows)]
    tables["equal_error"] = [json.dumps(row) for row in equal_error(rows)]
    text = ",\n".join(f'"{name}": [\n' + ",\n".join(table) + "\n]" for name, table in tables.items())
    RESULTS.write_text("{" + text + "}\n")


def first_file(*candidates):
    return next((path for path in candidates if path.is_file()), None)


def locate(args, name):
    """The scene and its reference points; None for what is not there."""
    scenes, references = Path(args.scenes), Path(args.reference or args.scenes)
    named = (scenes / name / "scene.glb", scenes / name / f"{name}.glb", scenes / f"{name}.glb")
    scene = first_file(*named, *sorted((scenes / name).glob("*.glb"))[:1])
    reference = first_file(references / name / "reference.npz", references / f"{name}.ref.npz")
    if name in ("cornell", "desk"):
        scene = scene or FIXTURES / name / "scene.glb"
        reference = reference or FIXTURES / name / "reference.npz"
    return scene, reference


def sweep_time(bench, name):
    """Error against CPU seconds, direct light from texels; on cornell also from the mesh, a curve a policy."""
    scene, reference = locate(bench.args, name)
    if not (scene and reference):
        print(f"{name}: no scene in --scenes, or no points in --reference; skipped", file=sys.stderr)
        return
    sizes, gather_errors = {
        "cornell": ((64, 128, 256, 512, 1024), GATHER_ERRORS),
        "desk": ((256, 512, 1024), GATHER_ERRORS),
        "office": ((512, 1024), GATHER_ERRORS[:3]),
    }[name]
    for size in sizes:
        for error in gather_errors:
            options = f"--size {size} --gather-error {error}"
            bench.measure(name, name, scene, reference, options, method="texel", size=size)
        bench.measure(name, name, scene, reference, f"--size {size}", method="default", size=size)
    if name == "cornell":
        for policy in POLICIES:
            for size in sizes[1:4]:
                options = f"--direct mesh --refine {policy} --size {size}"
                bench.measure(name, name, scene, reference, options, method=f"mesh, {policy}", size=size)


def sweep_bytes(bench):
    """Error against bytes, with texels where the light needs them and with the same density everywhere."""
    for name, sizes in BYTES_SIZES.items():
        scene, reference = locate(bench.args, name)
        if not (scene and reference):
            continue
        sizes = bench.args.sizes or sizes
        beyond = () if bench.args.sizes else (round(2**0.5 * sizes[-1]), 2 * sizes[-1])
        for density, more in (("light", ()), ("uniform", beyond)):
            for size in (*sizes, *more):
                options = f"--size {size} --density {density}"
                bench.measure("bytes", name, scene, reference, options, method=density, size=size)


def sweep_elements(bench):
    """Error of direct light against elements, on the desk."""
    scene, reference = locate(bench.args, "desk")
    arrays = dict(np.load(reference))
    arrays |= {"E": arrays["Edir"], "E_se": arrays["Edir_se"]}
    direct = bench.folder / "direct.npz"
    np.savez(direct, **arrays)
    for policy, thresholds in THRESHOLDS.items():
        for threshold in thresholds:
            options = (
                f"--direct mesh --max-reflectance 0 --size 1024 --refine {policy} --subdivision-threshold {threshold}"
            )
            bench.measure("elements", "desk", scene, direct, options, method=policy, threshold=threshold)


def equal_elements(rows, measure="detail"):
    """For each bake whose policy has the buffer, the same mesh size without it, read off the other curves.

    Curves are interpolated between their points on log axes; None outside of them.
    """
    curves = {}
    for row in rows:
        if row["part"] == "elements":
            curves.setdefault(row["method"], []).append((row["elements"], row[measure]))
    curves = {method: sorted(points) for method, points in curves.items()}

    def at(method, elements):
        counts, errors = np.array(curves.get(method, [(0, 0)]), float).T
        if not counts[0] <= elements <= counts[-1]:
            return None
        return round(float(np.exp(np.interp(np.log(elements), np.log(counts), np.log(errors)))), 5)

    table = []
    for method in ("cob", "cob+gradient"):
        for elements, error in curves.get(method, []):
            row = {"method": method, "elements": elements, "error": error}
            for other in ("uniform", "gradient"):
                without = at(other, elements)
                row[other] = without
                row[f"{other}_over_error"] = without and round(without / error, 2)
            table.append(row)
    return table


def equal_error(rows):
    """For each bake with texels where the light needs them, what a uniform density takes for the same error.

    Read off the uniform density's curve, without pages that are no better than a smaller one, between its points on log
    axes. Where the error is below all of the curve, the largest page stands in: `at_least` is true then.
    """
    curves = {}
    for row in rows:
        if row["part"] == "bytes" and row["method"] == "uniform":
            curves.setdefault(row["scene"], []).append(row)

    table = []
    for row in rows:
        curve = sorted(curves.get(row["scene"], []), key=lambda other: other["texels"])
        if row["part"] != "bytes" or row["method"] != "light" or not curve:
            continue
        for name in SETS:
            better = curve[:1]
            for other in curve[1:]:
                better += [other] if other[name] < better[-1][name] else []
            errors = np.array([other[name] for other in better])
            if row[name] > errors[0]:
                continue
            at_least = bool(row[name] < errors[-1])
            equal = {"scene": row["scene"], "size": row["size"], "set": name, "error": row[name], "at_least": at_least}
            for cost in ("texels", "bytes", "glb_bytes"):
                costs = [float(other[cost]) for other in better]
                takes = float(np.exp(np.interp(-np.log(row[name]), -np.log(errors), np.log(costs))))
                equal[f"{cost}_ratio"] = round((curve[-1][cost] if at_least else takes) / row[cost], 2)
            table.append(equal)
    return table


def print_equal_error(rows):
    print("\nWhat a uniform density takes for the same error, over what --density light takes: texels / bytes of the EXR")
    print(f"{'scene':18} {'size':>5} " + " ".join(f"{name:>18}" for name in SETS))
    table = {}
    for row in equal_error(rows):
        sign = ">" if row["at_least"] else " "
        table.setdefault((row["scene"], row["size"]), {})[row["set"]] = (
            f"{sign}{row['texels_ratio']:.2f} / {sign}{row['bytes_ratio']:.2f}"
        )
    for (scene, size), cells in table.items():
        print(f"{scene:18} {size:5} " + " ".join(f"{cells.get(name, '-'):>18}" for name in SETS))


def print_table(rows):
    print("\nDesk, direct light from the mesh, detail error in % at equal elements (times the error with the buffer)")
    print(f"{'policy':14} {'elements':>9} {'error':>7} {'uniform':>16} {'gradient':>16}")
    for row in equal_elements(rows):
        cells = [
            f"{100 * row[other]:8.2f} ({row[f'{other}_over_error']:.2f})" if row[other] else "-"
            for other in ("uniform", "gradient")
        ]
        print(f"{row['method']:14} {row['elements']:9} {100 * row['error']:7.2f} {cells[0]:>16} {cells[1]:>16}")


def sweep_blocker(bench):
    """A square blocker at rising heights between a floor and an emitter, against the closed form."""
    blocker.check()
    scene, reference = bench.folder / "blocker.glb", bench.folder / "blocker.npz"
    for side in BLOCKER_SIDES:
        for height in BLOCKER_HEIGHTS:
            blocker.write_scene(scene, side, height)
            np.savez(reference, **blocker.reference_points(side, height))
            for policy, fraction in BLOCKER_METHODS:
                options = f"--direct mesh --max-reflectance 0 --size 1024 --refine {policy} --cob-height {fraction}"
                name = f"blocker {side} at {height}"
                about = {"method": policy, "cob_height": fraction, "side": side, "height": height}
                bench.measure("blocker", name, scene, reference, options, **about)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", action="append", choices=PARTS, metavar="PART", help="a part; may be repeated")
    parser.add_argument("--redraw", action="store_true", help="draw from results.json, bake nothing")
    parser.add_argument("--keep", action="store_true", help="bake only what results.json lacks")
    parser.add_argument("--scenes", default=FIXTURES, metavar="DIR")
    parser.add_argument("--reference", metavar="DIR", help="where the points lie [default: the folder of --scenes]")
    parser.add_argument("--sizes", type=lambda text: [int(size) for size in text.split(",")], metavar="N,N,...",
                        help="the pages of the part bytes [default: each scene's]")  # fmt: skip
    parser.add_argument("--cobake", default=str(ROOT / "target" / "release" / "cobake"), metavar="PROGRAM")
    parser.add_argument("--evaluate", metavar="FILE.py", help="an evaluator, where cobake has no `compare`")
    args = parser.parse_args()

    rows = json.loads(RESULTS.read_text())["bakes"] if RESULTS.is_file() else []
    if not args.redraw:
        parts = args.only or PARTS
        if "office" in parts and None in locate(args, "office"):
            parts = [part for part in parts if part != "office"]
            print("the office is not in --scenes: its rows stay as they are", file=sys.stderr)
        here = [name for name in BYTES_SIZES if None not in locate(args, name)]
        kept = rows if args.keep else [
            row for row in rows
            if row["part"] not in parts or row["part"] == "bytes" and row["scene"] not in here
        ]  # fmt: skip
        with tempfile.TemporaryDirectory() as folder:
            bench = Bench(args, folder, kept)
            for part in parts:
                if part == "elements":
                    sweep_elements(bench)
                elif part == "blocker":
                    sweep_blocker(bench)
                elif part == "bytes":
                    sweep_bytes(bench)
                else:
                    sweep_time(bench, part)
            rows = bench.rows
        save(rows)
    print_table(rows)
    print_equal_error(rows)
    charts_draw.draw(rows, charts_draw.read_peers(TOOLS / "peers.jsonl"), CHARTS)


if __name__ == "__main__":
    main()
