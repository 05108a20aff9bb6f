#!/usr/bin/env python3
"""How much faster one build is than another: stages' CPU seconds, as ratios.

  python3 tools/bench.py --before OLD/cobake --after target/release/cobake
  python3 tools/bench.py --before target/release/cobake --after target/release/cobake --after-options "--gather-error 0.003"

Bakes each scene with both in turns, ROUNDS times, and compares each stage's least time: on a machine that others use,
too, only ratios from one run mean anything, and what others take is only ever added. The last column tells how far the
rounds spread: where that is wider than the gain, there is none. Scenes are cornell and the desk from the fixtures at 512
texels, or those named as FILE:SIZE. Needs nothing but Python.
"""

import argparse
import json
import subprocess
import tempfile
from pathlib import Path

FIXTURES = Path(__file__).resolve().parent.parent / "fixtures"
SCENES = [f"{FIXTURES / name / 'scene.glb'}:512" for name in ("cornell", "desk")]
# Shorter stages say nothing.
LEAST_SECONDS = 0.02


def stages(program, scene, size, options, folder):
    """CPU seconds by stage, the whole program's as `total`."""
    report = folder / "report.json"
    words = [program, "bake", scene, "-o", folder / "baked.glb", "--size", size, "--report", report, "--quiet"]
    subprocess.run([*words, *options.split()], check=True)
    time = json.loads(report.read_text())["time"]
    seconds = {name: stage["cpu_seconds"] for name, stage in time.items() if isinstance(stage, dict)}
    return seconds | {"total": time["total_cpu_seconds"]}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--before", required=True, metavar="PROGRAM")
    parser.add_argument("--after", required=True, metavar="PROGRAM")
    parser.add_argument("--before-options", default="", metavar="WORDS")
    parser.add_argument("--after-options", default="", metavar="WORDS")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("scenes", nargs="*", default=SCENES, metavar="FILE:SIZE")
    args = parser.parse_args()

    sides = ((args.before, args.before_options), (args.after, args.after_options))
    with tempfile.TemporaryDirectory() as folder:
        for named in args.scenes:
            scene, _, size = named.rpartition(":")
            runs = ([], [])
            for _ in range(args.rounds):
                for of_side, (program, options) in zip(runs, sides):
                    of_side.append(stages(program, scene, size, options, Path(folder)))
            print(f"{scene}, {size} texels\n  {'stage':13} {'before':>8} {'after':>8} {'times as fast':>14} {'spread':>7}")
            for name in runs[0][0]:
                before, after = ([run[name] for run in of_side] for of_side in runs)
                if min(before) < LEAST_SECONDS and min(after) < LEAST_SECONDS:
                    continue
                ratio = min(before) / max(min(after), 1e-9)
                spread = max(max(seconds) / max(min(seconds), 1e-9) - 1 for seconds in (before, after))
                print(f"  {name:13} {min(before):8.3f} {min(after):8.3f} {ratio:14.2f} {100 * spread:6.0f}%")


if __name__ == "__main__":
    main()
