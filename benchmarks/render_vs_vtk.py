#!/usr/bin/python3
"""Speed and error of slicer.render beside VTK's GPU and CPU volume ray casters, in one run.

Every renderer gets the same voxels, transfer function and camera; the truth is reference.raycast
(double precision, exact inside each cell). A picture's error is over red, green and blue, peak 1,
after rounding to 8 bits, which is what VTK delivers; that alone costs up to 0.0011 RMSE (58.9 dB).
Milliseconds are medians, the GPU's work finished, of the clock on the wall or, with --clock cpu, of
the processor time of all threads, which other work on the machine disturbs less; only ratios between
rows of one run mean anything.

Shaded scenes have one light at the eye, where VTK's headlight is, and gradients by central
differences interpolated like the values, which is what VTK's GPU ray caster computes. Its CPU ray
caster rounds normals to a table of directions and lights the voxels, not the samples: that is part
of its error. Surfaces at which light is added without limit are clamped to 1 in every picture.

    benchmarks/render_vs_vtk.py [--build build/release] [--quick] [--bricks] [--clock cpu] [--truth DIR] [--out DIR]

writes the table to standard output and as CSV and Markdown to DIR, and after it, for every picture
of VTK, the fastest of slicer.render whose error is not larger.

With --bricks, slicer.render draws bricks of 32^3 that lod.transfer-aware selects to 1/10000, balanced, of every
3-D volume in the folder of real volumes; a picture's time has that of the selection in it, and VTK is its
GPU ray caster alone.
"""

import argparse
import csv
import math
import pathlib
import statistics
import sys
import tempfile
import time

import numpy as np

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
import pictures
import vtk_ray_casters

LIGHT = {"ambient": 0.2, "diffuse": 0.7, "specular": 0.2, "shininess": 20}

MARSCHNER_LOBB = ("readers.phantom", {"kind": "marschner-lobb", "dims": [256, 256, 256], "type": "u8"})


def scenes(data, quick, bricks):
    found = {} if bricks else {"marschner-lobb": MARSCHNER_LOBB}
    if quick:
        kind, params = MARSCHNER_LOBB
        return {"marschner-lobb": (kind, dict(params, dims=[64, 64, 64]))}
    names = ["engine", "cthead", "cranium-ct"]
    if bricks and data:
        names = sorted(p.stem for p in data.glob("*.nrrd") if not p.stem.endswith("-4d"))
    for name in names:
        if data and (data / f"{name}.nrrd").exists():
            found[name] = ("readers.volume", {"path": str(data / f"{name}.nrrd")})
        else:
            print(f"skipped {name}: {name}.nrrd is not in the folder of real volumes (VOXLOOM_DATA)",
                  file=sys.stderr)
    return found


TRANSFERS = {
    "isosurfaces": {"preset": "isosurfaces"},
    "smooth": {"preset": "ramp", "ramp_start": 0.15, "ramp_end": 1.0, "ramp_opacity": 0.1},
}
SLICE_DISTANCES = (0.25, 0.5, 1, 2, 3, 4)
VTK_STEPS = (0.25, 0.5, 1, 2)
SELECTION = ("detail", "balanced")  # the nodes that select bricks
CLOCKS = {"wall": time.perf_counter, "cpu": time.process_time}
COLUMNS = ("scene", "transfer", "shaded", "size", "renderer", "setting", "ms", "rmse", "psnr_db",
           "max_error", "speed_vs_vtk_gpu")


def slicer_views(bricks):
    """{node: (setting, parameters)}: what slicer.render is asked to draw."""
    views = {}
    for classification in ("pre-integrated", "post"):
        for step in (0.5, 1, 2, 4) if bricks else SLICE_DISTANCES:
            name = f"slicer_{classification.replace('-', '_')}_{str(step).replace('.', '_')}"
            views[name] = (f"{classification}, {step} voxels",
                           {"classification": classification, "slice_distance": step})
    return views


def measure(drawer, vtk, scene, source, transfer, shaded, size, options, rows):
    repeat = options.repeat
    common = {"size": [size, size], "shading": shaded, "gradient": "central"}
    wires = {"source": "ct.volume", "transfer": "tf.transfer", "camera": "camera.camera",
             "lights": "lights.lights"}
    label = f"{scene}-{transfer}-{'shaded' if shaded else 'unshaded'}-{size}"
    nodes = {
        "ct": (source[0], {}, source[1]),
        "camera": ("scene.camera", {"fit": "ct.volume"}, {"azimuth": 30, "elevation": 20}),
    }
    eye = drawer.draw(label, nodes, ["camera.camera"])["values"]["camera.camera"]["eye"]
    if options.bricks:
        nodes |= {
            "pyramid": ("bricks.pyramid", {"volume": "ct.volume"}, {}),
            "detail": ("lod.transfer-aware", {"bricks": "pyramid.bricks", "camera": "camera.camera", "transfer": "tf.transfer"},
                       {"size": [size, size], "max_bricks": 1000000, "max_error": 0.0001}),
            "balanced": ("lod.balance", {"bricks": "pyramid.bricks", "selection": "detail.selection", "transfer": "tf.transfer"},
                         {"max_bricks": 0}),
        }
    drawn = dict(wires, source="pyramid.bricks", selection="balanced.selection") if options.bricks else wires
    nodes |= {
        "tf": ("scene.transfer", {"fit": "ct.volume"}, TRANSFERS[transfer]),
        "lights": ("scene.lights", {}, {"headlight": 0, "point": [eye], **LIGHT}),
        "truth": ("reference.raycast", wires, common),
    }
    # The truth takes the longest by far, and is the same in every run.
    kept = pathlib.Path(options.truth) / f"{label}.npy" if options.truth else None
    known = kept is not None and kept.exists()
    outputs = ["ct.volume", "tf.transfer", "camera.camera"] + ([] if known else ["truth.image"])
    views = slicer_views(options.bricks) if drawer.has("render-slicer") else {}
    for name, (_, params) in views.items():
        nodes[name] = ("slicer.render", drawn, {**common, **params})
        outputs.append(f"{name}.image")
    selecting = SELECTION if options.bricks else ()
    result = drawer.draw(label, nodes, outputs, timed=[*views, *selecting], repeat=repeat)
    truth = np.load(kept) if known else pictures.picture(result, "truth.image")
    if kept and not known:
        kept.parent.mkdir(parents=True, exist_ok=True)
        np.save(kept, truth)

    measured = []

    def row(renderer, setting, seconds, image):
        measured.append([scene, transfer, shaded, size, renderer, setting, seconds * 1e3,
                         *pictures.errors(image, truth)])

    for name, (setting, _) in views.items():
        row("slicer.render", setting, sum(statistics.median(result["times"][n][options.clock]) for n in (name, *selecting)),
            pictures.in_8_bits(pictures.picture(result, f"{name}.image")))

    gpu = {}
    if vtk:
        volume, tf = result["values"]["ct.volume"], result["values"]["tf.transfer"]
        table = vtk_ray_casters.TransferTable(tf["points"], tf["reference_length"], volume["range"])
        voxels = np.load(volume["file"])
        for kind in ("gpu",) if options.bricks else ("gpu", "cpu"):
            caster = vtk_ray_casters.RayCaster(
                vtk, kind, voxels, volume["index_to_world"], table, result["values"]["camera.camera"],
                (size, size), LIGHT if shaded else None)
            for step in VTK_STEPS[options.bricks:]:
                image, seconds = caster.draw(step, repeat, clock=CLOCKS[options.clock])
                if kind == "gpu":
                    gpu[step] = seconds
                row(f"VTK {kind.upper()}", f"{step} voxels", seconds, image)
            caster.close()
    # Against the GPU mapper as the published figures have it: half-voxel steps.
    for line in measured:
        line.append(gpu[0.5] * 1e3 / line[6] if gpu else math.nan)
        print("{:15} {:12} {:8} {:5} {:14} {:24} {:9.1f} ms  rmse {:.5f}  {:5.1f} dB  max {:.3f}  x{:.2f}"
              .format(line[0], line[1], "shaded" if line[2] else "unshaded", *line[3:]), flush=True)
    rows += measured


def at_equal_error(rows):
    """Lines of Markdown: each of VTK's pictures, and the fastest of ours that is no worse."""
    lines = ["| scene | size | VTK | ms | RMSE | slicer.render, no worse | ms | RMSE | times as fast |",
             "|---|---|---|---|---|---|---|---|---|"]
    for vtk in (r for r in rows if r[4].startswith("VTK")):
        no_worse = [r for r in rows if r[:4] == vtk[:4] and r[4] == "slicer.render" and r[7] <= vtk[7]]
        scene = f"{vtk[0]}, {vtk[1]}{', shaded' if vtk[2] else ''}"
        theirs = f"| {scene} | {vtk[3]} | {vtk[4][4:]}, {vtk[5]} | {vtk[6]:.1f} | {vtk[7]:.5f} "
        if no_worse:
            ours = min(no_worse, key=lambda r: r[6])
            lines.append(theirs + f"| {ours[5]} | {ours[6]:.1f} | {ours[7]:.5f} | {vtk[6] / ours[6]:.2f} |")
        else:
            lines.append(theirs + "| none | | | |")
    return "\n".join(lines) + "\n"


def write_tables(rows, out):
    out.mkdir(parents=True, exist_ok=True)
    with open(out / "render_vs_vtk.csv", "w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(COLUMNS)
        writer.writerows(rows)
    with open(out / "render_vs_vtk.md", "w") as file:
        file.write("| scene | size | renderer | setting | ms | RMSE | PSNR | max | speed vs VTK GPU |\n")
        file.write("|---|---|---|---|---|---|---|---|---|\n")
        for scene, transfer, shaded, size, renderer, setting, ms, rmse, psnr, worst, ratio in rows:
            file.write(f"| {scene}, {transfer}{', shaded' if shaded else ''} | {size} | {renderer} | "
                       f"{setting} | {ms:.1f} | {rmse:.5f} | {psnr:.1f} dB | {worst:.3f} | {ratio:.2f} |\n")
        equal = at_equal_error(rows)
        file.write("\n" + equal)
    print(equal + f"written: {out / 'render_vs_vtk.csv'} and .md")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--build", default=str(pictures.SOURCE / "build" / "release"))
    parser.add_argument("--out", default="out/render_vs_vtk", help="folder of the tables")
    parser.add_argument("--quick", action="store_true", help="one small scene, one size: seconds")
    parser.add_argument("--bricks", action="store_true", help="draw bricks, of all real volumes, beside VTK's GPU ray caster")
    parser.add_argument("--sizes", type=int, nargs="+", help="picture sizes (256 512 1024; with --bricks 512 1024)")
    parser.add_argument("--unshaded", action="store_true", help="no shaded pictures")
    parser.add_argument("--scenes", nargs="+", help="only these")
    parser.add_argument("--repeat", type=int, help="pictures per median (9)")
    parser.add_argument("--clock", choices=CLOCKS, default="wall", help="time by the clock or of the processor")
    parser.add_argument("--truth", help="folder in which reference pictures are kept from run to run")
    options = parser.parse_args()

    vtk = None
    try:
        vtk = vtk_ray_casters.import_vtk()
        vtk_ray_casters.start_display()
    except (ImportError, OSError, RuntimeError) as reason:
        print(f"skipped VTK: {reason} (packages python3-vtk9 and xvfb)", file=sys.stderr)
    sizes = options.sizes or ([96] if options.quick else [256, 512, 1024][options.bricks:])
    options.repeat = options.repeat or (3 if options.quick else 9)
    rows = []
    with tempfile.TemporaryDirectory(prefix="voxloom-bench-") as folder:
        drawer = pictures.Drawer(options.build, folder)
        if not drawer.has("render-slicer"):
            print("skipped slicer.render: its plugin is not built", file=sys.stderr)
        for scene, source in scenes(pictures.data_folder(), options.quick, options.bricks).items():
            if options.scenes and scene not in options.scenes:
                continue
            for transfer in TRANSFERS:
                for shaded in (False,) if options.unshaded else (False, True):
                    for size in sizes:
                        measure(drawer, vtk, scene, source, transfer, shaded, size, options, rows)
    write_tables(rows, pathlib.Path(options.out))


if __name__ == "__main__":
    main()
