#!/usr/bin/env python3
"""Codecs side by side on real volumes: a table, and plots of rate and of speed against error.

    benchmarks/codecs.py                        # the volumes and codecs below: hours
    benchmarks/codecs.py --volumes engine --codecs wavelet:coder=fast,zfp --targets 40,50,lossless
    benchmarks/codecs.py --quick                # the middle of one volume: a smoke test
    benchmarks/codecs.py --plot                 # draws again what codecs.json holds

Everything is measured by bench-codecs in this run, and written to docs/results: codecs.md, codecs.json,
codecs-rate.svg and codecs-speed.svg. Volumes that are not there are skipped with a word.
"""

import argparse
import json
import math
import os
import pathlib
import subprocess
import sys
import tempfile

from chart import write_chart
from data import SOURCE, data_folder

VOLUMES = ["engine", "cranium-ct", "turbulence-wmag"]
# Cubes as they come, and for codecs of pictures whole slices too, which suit them better.
SLICES = "brick=[65535,65535,1]"
CODECS = ["wavelet:coder=dense", "wavelet:coder=fast", "wavelet:coder=paper", "zfp", "blosc:coder=zstd", "blosc:coder=lz4",
          "jpeg2000", f"jpeg2000:{SLICES}", "jpegls", f"jpegls:{SLICES}", "jpegxl", f"jpegxl:{SLICES}", "raw"]
TARGETS = ["40", "45", "50", "55", "60", "lossless"]


def measure(build, volumes, codecs, targets, crop):
    program = pathlib.Path(build) / "bin" / "bench-codecs"
    if not program.exists():
        sys.exit(f"{program} is not there; build it with: cmake --build {build} --target bench-codecs")
    with tempfile.TemporaryDirectory() as folder:
        out = pathlib.Path(folder) / "rows.json"
        command = [str(program), *volumes, "--codecs", ",".join(codecs), "--targets", ",".join(targets), "--json", str(out)]
        if crop:
            command += ["--crop", str(crop)]
        print(" ".join(command), file=sys.stderr)
        subprocess.run(command, check=True)
        return json.loads(out.read_text())


def codec_of(row):
    """zfp, wavelet fast, jpegls slices: the codec and what of its setting is no target."""
    name = row["node"].removesuffix(".encode")
    words = []
    setting = row["setting"].strip("{}").replace(SLICES.replace("=", ": "), "slices: ")
    for part in setting.split(", "):
        key, _, value = part.partition(": ")
        if key and key not in ("target", "psnr"):
            words.append(value if key in ("coder",) else f"{key} {value}".strip())
    return " ".join([name] + words)


def target_of(row):
    words = dict(part.partition(": ")[::2] for part in row["setting"].strip("{}").split(", "))
    return words["psnr"] + " dB" if "psnr" in words else "lossless"


def psnr_of(row):
    return math.inf if row["psnr"] is None else row["psnr"]


def table(rows):
    lines = ["| codec | target | bits a voxel | PSNR, dB | largest error | encode, MB/s | with search | decode, MB/s | two threads "
             "| 32^3 warm, us | cold, us | cold p99, us |", "|---|---|" + "---:|" * 10]
    for r in rows:
        psnr = psnr_of(r)
        lines.append(f"| {codec_of(r)} | {target_of(r)} | {r['bpv']:.4f} | {'∞' if math.isinf(psnr) else f'{psnr:.2f}'} "
                     f"| {r['max_error']:.4g} | {r['encode_mb_s']:.1f} | {r['encode_all_mb_s']:.1f} | {r['decode_mb_s']:.1f} "
                     f"| {r['two_threads']:.2f} | {r['warm_us'][0]:.0f} | {r['cold_us'][0]:.0f} | {r['cold_us'][1]:.0f} |")
    return lines


def plot(rows, key, label, path):
    """A panel a volume: PSNR over `key`, a line a codec."""
    rows = [r for r in rows if not math.isinf(psnr_of(r)) and r[key]]
    panels = {}
    for r in rows:
        panels.setdefault(pathlib.Path(r["volume"]).stem, {}).setdefault(codec_of(r), []).append((r[key], psnr_of(r)))
    for lines in panels.values():
        for line in lines.values():
            line.sort(key=lambda point: point[1])
    if panels:
        write_chart(path, panels, label, "PSNR, dB")


def write(rows, command, folder):
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "codecs.json").write_text(json.dumps({"command": command, "rows": rows}, indent=1) + "\n")
    lines = ["# Codecs side by side", "", f"Measured in one run of `{command}`, on one machine. MB/s are of the original's bytes "
             "over CPU time, so per core: encoding is one pass of the codec, `with search` all that the node did. `two threads` "
             "is how much faster two threads read everything than one. A region of 32^3 is read by one thread, warm with its "
             "bricks' ancestors decoded, cold with nothing. Bits hold everything that a file holds. The peers' bricks are 64^3, `slices` "
             "whole slices, which codecs of pictures compress best and fetch slowest.", "",
             "![Rate against error](codecs-rate.svg)", "", "![Decoding speed against error](codecs-speed.svg)"]
    for volume in dict.fromkeys(r["volume"] for r in rows):
        mine = [r for r in rows if r["volume"] == volume]
        lines += ["", f"## {pathlib.Path(volume).stem}", "", mine[0]["summary"] + ".", ""] + table(mine)
    (folder / "codecs.md").write_text("\n".join(lines) + "\n")
    plot(rows, "bpv", "bits a voxel", folder / "codecs-rate.svg")
    plot(rows, "decode_mb_s", "decoding, MB/s per core", folder / "codecs-speed.svg")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--build", default=str(SOURCE / "build" / "release"))
    parser.add_argument("--volumes", default=",".join(VOLUMES), help="names in the data folder, or files")
    parser.add_argument("--codecs", default="", help="as for bench-codecs; empty: the list in this file")
    parser.add_argument("--targets", default=",".join(TARGETS))
    parser.add_argument("--out", default=str(SOURCE / "docs" / "results"))
    parser.add_argument("--quick", action="store_true", help="the middle 64^3 of the first volume")
    parser.add_argument("--plot", action="store_true", help="no measuring: draws what codecs.json holds")
    arguments = parser.parse_args()
    out = pathlib.Path(arguments.out)
    if arguments.plot:
        kept = json.loads((out / "codecs.json").read_text())
        return write(kept["rows"], kept["command"], out)
    volumes = []
    for name in arguments.volumes.split(","):
        folder = data_folder()
        path = pathlib.Path(name) if os.path.exists(name) or not folder else folder / f"{name}.nrrd"
        if path.exists():
            volumes.append(str(path))
        else:
            print(f"{name}: is not there, left out", file=sys.stderr)
    if not volumes:
        sys.exit("none of the volumes is there; set VOXLOOM_DATA to their folder")
    if arguments.quick:
        volumes = volumes[:1]
    codecs = [arguments.codecs] if arguments.codecs else CODECS
    rows = measure(arguments.build, volumes, codecs, arguments.targets.split(","), 64 if arguments.quick else 0)
    for row in rows:
        row["volume"] = pathlib.Path(row["volume"]).name
    write(rows, " ".join(["benchmarks/codecs.py", *sys.argv[1:]]), out)


if __name__ == "__main__":
    main()
