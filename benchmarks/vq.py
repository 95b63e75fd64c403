#!/usr/bin/env python3
"""The vector quantiser: rate against error over its parameters, training time against error, beside zfp and wavelet.

    benchmarks/vq.py                       # the volumes below: some minutes
    benchmarks/vq.py --volumes engine --crop 64

Measured by bench-codecs in this run, and written to docs/results: vq.md, vq.json and vq-rate.svg. Volumes that are not there
are skipped with a word.
"""

import argparse
import json
import pathlib
import re
import subprocess
import sys
import tempfile

from chart import write_chart
from data import SOURCE, data_folder

VOLUMES = ["engine", "cthead"]
GRIDS = [1, 2, 4]
CODEWORDS = [64, 128, 256]
SWEEPS = [0, 1, 2, 5, 20]
SAMPLES = [4096, 16384, 65536, 262144]


def measure(build, volume, node, settings, crop):
    program = pathlib.Path(build) / "bin" / "bench-codecs"
    if not program.exists():
        sys.exit(f"{program} is not there; build it with: cmake --build {build} --target bench-codecs")
    with tempfile.TemporaryDirectory() as folder:
        out = pathlib.Path(folder) / "rows.json"
        command = [str(program), str(volume), "--codec", node, "--regions", "64", "--json", str(out)]
        for setting in settings:
            command += ["--set", "{" + ", ".join(f"{key}: {value}" for key, value in setting.items()) + "}"]
        if crop:
            command += ["--crop", str(crop)]
        subprocess.run(command, check=True)
        rows = json.loads(out.read_text())
    for row, setting in zip(rows, settings):
        row["parameters"] = setting
        voxels, voxel_bytes = size_of(row["summary"])
        row["seconds"] = voxels * voxel_bytes / 1e6 / row["encode_all_mb_s"]
        row["decode_mvoxel_s"] = row["decode_mb_s"] / voxel_bytes
    return rows


def size_of(summary):
    """Voxels, and bytes of each, of "256 x 256 x 128 u8, spacing ..."."""
    x, y, z, kind = re.match(r"(\d+) x (\d+) x (\d+) (?:\d+ x )?[uif](\d+)", summary).groups()
    return int(x) * int(y) * int(z), int(kind) // 8


def run(build, volume, crop):
    """All rows of one volume: our parameters, then the peers at our smallest, middle and largest rate."""
    rate = [{"macroblocks": [m, m, m], "codewords": k, "loop": loop}
            for m in GRIDS for k in CODEWORDS for loop in ("closed", "open")]
    rows = {"rate": measure(build, volume, "vq.encode", rate, crop)}
    rows["sweeps"] = measure(build, volume, "vq.encode", [{"sweeps": n} for n in SWEEPS], crop)
    rows["sample"] = measure(build, volume, "vq.encode", [{"sample": n} for n in SAMPLES], crop)
    rates = sorted(row["bpv"] for row in rows["rate"])
    targets = [round(r, 4) for r in (rates[0], rates[len(rates) // 2], rates[-1])]
    rows["wavelet"] = measure(build, volume, "wavelet.encode", [{"target": "bpv", "bpv": r} for r in targets], crop)
    zfp = [{"target": "bpv", "bpv": r, "brick": [32, 32, 32]} for r in targets]
    rows["zfp"] = measure(build, volume, "zfp.encode", zfp, crop)
    return rows


def line_of(name, r):
    psnr = "∞" if r["psnr"] is None else f"{r['psnr']:.2f}"
    return (f"| {name} | {r['bpv']:.4f} | {psnr} | {r['max_error']:.4g} | {r['seconds']:.2f} "
            f"| {r['decode_mvoxel_s']:.0f} |")


def table(first, rows):
    head = f"| {first} | bits a voxel | PSNR, dB | largest error | encoding, CPU s | decoding, Mvoxel/s |"
    return [head, "|---|" + "---:|" * 5] + [line_of(name, r) for name, r in rows]


def write(results, command, folder):
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "vq.json").write_text(json.dumps({"command": command, "volumes": results}, indent=1) + "\n")
    lines = ["# The vector quantiser", "", f"Measured in one run of `{command}`, on one machine. Bits hold everything that a file holds, codebooks "
             "and index too. Encoding is all that the node did, training and checks included; decoding is every brick once, "
             "on one core, checksums included. Peers are aimed at the same bits; zfp has bricks of 32^3, as the quantiser has.",
             "", "![Rate against error](vq-rate.svg)"]
    panels = {}
    for name, groups in results.items():
        lines += ["", f"## {name}", "", groups["rate"][0]["summary"] + ".", ""]
        rows = []
        for r in groups["rate"]:
            p = r["parameters"]
            grid = p["macroblocks"][0]
            rows.append((f"{grid}^3 macroblocks, {p['codewords']} codewords, {p['loop']}", r))
            panels.setdefault(name, {}).setdefault(f"vq {grid}^3 {p['loop']}", []).append((r["bpv"], r["psnr"]))
        for peer in ("wavelet", "zfp"):
            for r in groups[peer]:
                rows.append((peer, r))
                if r["psnr"] is not None:
                    panels[name].setdefault(peer, []).append((r["bpv"], r["psnr"]))
        lines += table("codec", rows)
        lines += ["", "Sweeps at the most, one macroblock, 256 codewords, closed loop:", ""]
        lines += table("sweeps", [(r["parameters"]["sweeps"], r) for r in groups["sweeps"]])
        lines += ["", "Blocks that the codebooks are trained with, at the most:", ""]
        lines += table("blocks", [(r["parameters"]["sample"], r) for r in groups["sample"]])
    (folder / "vq.md").write_text("\n".join(lines) + "\n")
    write_chart(folder / "vq-rate.svg", panels, "bits a voxel", "PSNR, dB")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--build", default=str(SOURCE / "build" / "release"))
    parser.add_argument("--volumes", default=",".join(VOLUMES), help="names in the data folder")
    parser.add_argument("--crop", type=int, default=0, help="take the middle N^3 voxels")
    parser.add_argument("--out", default=str(SOURCE / "docs" / "results"))
    arguments = parser.parse_args()
    results = {}
    for name in arguments.volumes.split(","):
        path = (data_folder() or pathlib.Path()) / f"{name}.nrrd"
        if path.exists():
            results[name] = run(arguments.build, path, arguments.crop)
        else:
            print(f"{name}: is not there, left out", file=sys.stderr)
    if not results:
        sys.exit("none of the volumes is there; set VOXLOOM_DATA to their folder")
    command = "benchmarks/vq.py" + "".join(" " + word for word in sys.argv[1:])
    write(results, command, pathlib.Path(arguments.out))


if __name__ == "__main__":
    main()
