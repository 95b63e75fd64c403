#!/usr/bin/python3
"""Tables of level of detail, as docs/results/lod.md has them: each row is a run of graphs/selection.yaml.

promise   the error that a selection promises against the one that its picture has, for a steep and a nearly
          linear transfer function
sizes     cost of a picture of one size and one promised error against the size of the volume
bricks    the same against the size of the bricks
"""
import argparse
import csv
import json
import subprocess
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent


def rows(file):
    with open(file, newline="", encoding="utf-8") as f:
        return list(csv.reader(f))


def run(voxloom, settings):
    """What one run says: bricks selected, promised error, measured RMSE and largest error, counters of the nodes."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder)
        command = [voxloom, "run", ROOT / "graphs/selection.yaml", "--quiet", "--out", out, "--report", out / "report.json",
                   "--output", "levels.table", "--output", "error.table"]
        for name, value in {"detail.max_bricks": 1 << 20, "balanced.max_bricks": 0, **settings}.items():
            command += ["--set", f"{name}={value}"]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        levels, error = rows(out / "levels.table.csv"), rows(out / "error.table.csv")
        nodes = {n["id"]: n for n in json.loads((out / "report.json").read_text(encoding="utf-8"))["nodes"]}
        of_error = dict(zip(error[0], error[1]))
        return {"bricks": int(levels[-1][1]), "promised": float(levels[-1][-1]), "rmse": float(of_error["rmse"]),
                "largest": float(of_error["max_error"]), "view": nodes["view"]["counters"], "full": nodes["full"]["counters"]}


def promise(voxloom, errors):
    print("| transfer function | asked for | promised, of the peak | bricks | RMSE | RMSE / promised | largest |")
    print("|---|---|---|---|---|---|---|")
    for preset in ("materials", "ramp"):
        for error in errors:
            r = run(voxloom, {"tf.preset": preset, "detail.max_error": error})
            print(f"| {preset} | {error} | {r['promised']:.4f} | {r['bricks']} | {r['rmse']:.4f} | {r['rmse'] / r['promised']:.2f} "
                  f"| {r['largest']:.3f} |", flush=True)


def sizes(voxloom, all_sizes):
    print("| N | bricks | of level 0 | MiB uploaded | of the dense volume | samples, million | dense | RMSE |")
    print("|---|---|---|---|---|---|---|---|")
    for n in all_sizes:
        r = run(voxloom, {"tf.preset": "ramp", "detail.max_error": 0.01, "head.dims": f"[{n},{n},{n}]"})
        view, full = r["view"], r["full"]
        print(f"| {n} | {r['bricks']} | {(n + 15) // 16 * ((n + 15) // 16) ** 2} | {view['bytes uploaded'] / 2**20:.1f} "
              f"| {full['bytes uploaded'] / 2**20:.1f} | {view['samples'] / 1e6:.1f} | {full['samples'] / 1e6:.1f} "
              f"| {r['rmse']:.4f} |", flush=True)


def bricks(voxloom):
    print("| brick | bricks | pages | MiB uploaded | voxels of the selection, million | samples, million | promised | RMSE |")
    print("|---|---|---|---|---|---|---|---|")
    for k in (8, 16, 32):
        r = run(voxloom, {"tf.preset": "ramp", "detail.max_error": 0.01, "pyramid.brick": f"[{k},{k},{k}]"})
        view = r["view"]
        print(f"| {k}³ | {r['bricks']} | {view['pages drawn']:.0f} | {view['bytes uploaded'] / 2**20:.1f} "
              f"| {r['bricks'] * k**3 / 1e6:.1f} | {view['samples'] / 1e6:.1f} | {r['promised']:.4f} | {r['rmse']:.4f} |", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("figure", choices=["promise", "sizes", "bricks"])
    parser.add_argument("--voxloom", default=ROOT / "build/release/bin/voxloom", help="the program to run")
    parser.add_argument("--errors", type=float, nargs="+", default=[0.08, 0.04, 0.02, 0.01, 0.005], help="max_error of promise")
    parser.add_argument("--sizes", type=int, nargs="+", default=[128, 256, 384], help="voxels a side of sizes")
    options = parser.parse_args()
    if options.figure == "promise":
        promise(options.voxloom, options.errors)
    elif options.figure == "sizes":
        sizes(options.voxloom, options.sizes)
    else:
        bricks(options.voxloom)


if __name__ == "__main__":
    main()
