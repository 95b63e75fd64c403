#!/usr/bin/python3
"""What classification costs and gives: pre, post and pre-integrated at 0.5, 1 and 2 voxels.

Draws several semi-transparent isosurfaces, the scene in which errors of sampling show most, with
slicer.render, and states each picture's milliseconds (median) and error against reference.raycast
(over red, green and blue in linear float, peak 1).

    benchmarks/classification_error.py [VOLUME] [--build build/release] [--size 512] [--out DIR]

prints the table as Markdown and writes it, and a CSV with p95, PSNR and maximum, to DIR. Without a
VOLUME the engine of the folder of real volumes is drawn, or a Marschner-Lobb phantom.
"""

import argparse
import csv
import pathlib
import statistics
import sys
import tempfile

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
import pictures

CLASSIFICATIONS = ("pre", "post", "pre-integrated")
DISTANCES = (0.5, 1, 2)
COLUMNS = ("classification", "slice_distance", "ms_median", "ms_p95", "rmse", "psnr_db", "max_error")


def source_of(volume):
    data = pictures.data_folder()
    if volume is None and data and (data / "engine.nrrd").exists():
        volume = data / "engine.nrrd"
    if volume is None:
        return "marschner-lobb 256^3", ("readers.phantom", {}, {"kind": "marschner-lobb",
                                                                "dims": [256, 256, 256], "type": "u8"})
    path = pathlib.Path(volume).resolve()
    return path.name.split(".")[0], ("readers.volume", {}, {"path": str(path)})


def measure(drawer, source, size, repeat):
    common = {"size": [size, size]}
    wires = {"source": "ct.volume", "transfer": "tf.transfer", "camera": "camera.camera"}
    nodes = {
        "ct": source,
        "tf": ("scene.transfer", {"fit": "ct.volume"}, {"preset": "isosurfaces"}),
        "camera": ("scene.camera", {"fit": "ct.volume"}, {}),
        "truth": ("reference.raycast", wires, common),
    }
    views = {}
    for classification in CLASSIFICATIONS:
        for distance in DISTANCES:
            name = f"view_{len(views)}"
            views[name] = (classification, distance)
            nodes[name] = ("slicer.render", wires, {**common, "classification": classification,
                                                    "slice_distance": distance})
    result = drawer.draw("classification", nodes, ["truth.image", *(f"{v}.image" for v in views)],
                         timed=views, repeat=repeat)
    truth = pictures.picture(result, "truth.image")
    rows = []
    for name, (classification, distance) in views.items():
        ms = sorted(1e3 * seconds for seconds in result["times"][name]["wall"])
        p95 = ms[min(len(ms) - 1, int(0.95 * len(ms)))]
        rows.append([classification, distance, statistics.median(ms), p95,
                     *pictures.errors(pictures.picture(result, f"{name}.image"), truth)])
    return rows


def markdown(rows, title):
    """One line a classification, one column a distance: the README's table."""
    lines = [f"| {title} | " + " | ".join(f"{d} voxels" for d in DISTANCES) + " |",
             "|---|" + "---|" * len(DISTANCES)]
    for classification in CLASSIFICATIONS:
        cells = [f"{ms:.0f} ms, RMSE {rmse:.4f}"
                 for c, _, ms, _, rmse, _, _ in rows if c == classification]
        lines.append(f"| {classification} | " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("volume", nargs="?")
    parser.add_argument("--build", default=str(pictures.SOURCE / "build" / "release"))
    parser.add_argument("--out", default="out/classification_error")
    parser.add_argument("--size", type=int, default=512)
    parser.add_argument("--repeat", type=int, default=20, help="pictures per median")
    options = parser.parse_args()

    with tempfile.TemporaryDirectory(prefix="voxloom-bench-") as folder:
        drawer = pictures.Drawer(options.build, folder)
        if not drawer.has("render-slicer"):
            sys.exit("slicer.render is what is measured, and its plugin is not built")
        title, source = source_of(options.volume)
        rows = measure(drawer, source, options.size, options.repeat)
    table = markdown(rows, f"{title}, {options.size}²")
    print(table, end="")
    out = pathlib.Path(options.out)
    out.mkdir(parents=True, exist_ok=True)
    (out / "classification_error.md").write_text(table)
    with open(out / "classification_error.csv", "w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(COLUMNS)
        writer.writerows(rows)


if __name__ == "__main__":
    main()
