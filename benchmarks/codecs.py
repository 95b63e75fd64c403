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

from data import SOURCE, data_folder

VOLUMES = ["engine", "cranium-ct", "turbulence-wmag"]
# Cubes as they come, and for codecs of pictures whole slices too, which suit them better.
SLICES = "brick=[65535,65535,1]"
CODECS = ["wavelet:coder=dense", "wavelet:coder=fast", "wavelet:coder=paper", "zfp", "blosc:coder=zstd", "blosc:coder=lz4",
          "jpeg2000", f"jpeg2000:{SLICES}", "jpegls", f"jpegls:{SLICES}", "jpegxl", f"jpegxl:{SLICES}", "raw"]
TARGETS = ["40", "45", "50", "55", "60", "lossless"]
COLORS = ["#1b6ca8", "#c0392b", "#27864a", "#8e44ad", "#d68910", "#17807e", "#7f5539", "#c2185b", "#555555", "#3949ab",
          "#6a8d00", "#00838f", "#a04000"]


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


def ticks(lo, hi):
    """1, 2, 5, 10, ... between lo and hi."""
    return [m * 10.0 ** e for e in range(math.floor(math.log10(lo)), math.ceil(math.log10(hi)) + 1) for m in (1, 2, 5)
            if lo <= m * 10.0 ** e <= hi]


def plot(rows, key, label, path):
    """A panel a volume: `key` on a logarithmic axis against PSNR, a line a codec."""
    rows = [r for r in rows if not math.isinf(psnr_of(r)) and r[key]]
    if not rows:
        return
    volumes = list(dict.fromkeys(r["volume"] for r in rows))
    codecs = list(dict.fromkeys(codec_of(r) for r in rows))
    color = {c: COLORS[i % len(COLORS)] for i, c in enumerate(codecs)}
    width, height, left, top = 460, 340, 56, 34
    out = [f'<svg xmlns="http://www.w3.org/2000/svg" width="{(width + left) * len(volumes) + 190}" height="{height + top + 50}" '
           f'font-family="sans-serif" font-size="12"><rect width="100%" height="100%" fill="white"/>']
    for v, volume in enumerate(volumes):
        mine = [r for r in rows if r["volume"] == volume]
        lo, hi = min(r[key] for r in mine) / 1.15, max(r[key] for r in mine) * 1.15
        bottom, ceiling = min(map(psnr_of, mine)) - 2, max(map(psnr_of, mine)) + 2
        x0 = left + v * (width + left)
        x = lambda value: x0 + (width - 20) * math.log(value / lo) / math.log(hi / lo)
        y = lambda value: top + height * (ceiling - value) / (ceiling - bottom)
        out.append(f'<text x="{x0}" y="20" font-weight="bold">{pathlib.Path(volume).stem}</text>')
        for t in ticks(lo, hi):
            out.append(f'<path d="M{x(t):.1f} {top}v{height}" stroke="#e4e4e4"/>'
                       f'<text x="{x(t):.1f}" y="{top + height + 16}" text-anchor="middle">{t:g}</text>')
        for t in range(math.ceil(bottom / 5) * 5, math.floor(ceiling) + 1, 5):
            out.append(f'<path d="M{x0} {y(t):.1f}h{width - 20}" stroke="#e4e4e4"/>'
                       f'<text x="{x0 - 6}" y="{y(t) + 4:.1f}" text-anchor="end">{t}</text>')
        out.append(f'<rect x="{x0}" y="{top}" width="{width - 20}" height="{height}" fill="none" stroke="#888"/>'
                   f'<text x="{x0 + width / 2 - 10}" y="{top + height + 36}" text-anchor="middle">{label}</text>')
        for c in codecs:
            points = sorted((psnr_of(r), r[key]) for r in mine if codec_of(r) == c)
            line = " ".join(f"{x(value):.1f},{y(psnr):.1f}" for psnr, value in points)
            out.append(f'<polyline points="{line}" fill="none" stroke="{color[c]}" stroke-width="1.6"/>')
            out += [f'<circle cx="{x(value):.1f}" cy="{y(psnr):.1f}" r="3" fill="{color[c]}"/>' for psnr, value in points]
    x0 = left + len(volumes) * (width + left) - 30
    for i, c in enumerate(codecs):
        out.append(f'<rect x="{x0}" y="{top + 18 * i}" width="14" height="4" fill="{color[c]}"/>'
                   f'<text x="{x0 + 20}" y="{top + 18 * i + 7}">{c}</text>')
    out.append(f'<text x="14" y="{top + height / 2}" transform="rotate(-90 14 {top + height / 2})" text-anchor="middle">PSNR, dB</text></svg>')
    path.write_text("\n".join(out) + "\n")


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
