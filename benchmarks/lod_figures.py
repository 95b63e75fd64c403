#!/usr/bin/python3
"""Tables of level of detail, as docs/results/lod.md has them.

promise    the error that a selection promises against the one that its picture has, for steep and nearly linear
           transfer functions; lod-promise.svg
sizes      cost of a picture from within a volume, of one size and one error, against the size of the volume, beside
           the count of Guthe et al., appendix; lod-sizes.svg
bricks     cost and error against the size of the bricks
turntable  what changes from frame to frame beside what changes at full resolution
walk       a flight through a compressed CT with the settings of Guthe et al.: cost with and without caches, error
plane      a cutting plane at the finest level against one that is fine about its middle, as in LaMar et al., table 1

Tables go to standard output, charts to --charts. Compressed phantoms of sizes and walk are made once, in --volumes.
"""
import argparse
import csv
import json
import math
import subprocess
import tempfile
from pathlib import Path

from chart import write_chart
from data import data_folder

ROOT = Path(__file__).resolve().parent.parent


def rows(file):
    with open(file, newline="", encoding="utf-8") as f:
        return list(csv.reader(f))


def run_graph(voxloom, out, nodes, outputs, *more):
    """Runs nodes, each (id, type, inputs, settings) with the last two in YAML; gives the counters and seconds of each."""
    graph = out / "graph.yaml"
    lines = [f"  - {{ id: {i}, type: {t}, in: {{ {wires} }}, set: {{ {settings} }} }}" for i, t, wires, settings in nodes]
    graph.write_text("voxloom: 1\nnodes:\n" + "\n".join(lines) + "\n", encoding="utf-8")
    command = [voxloom, "run", graph, "--quiet", "--out", out, "--report", out / "report.json", *more]
    for output in outputs:
        command += ["--output", output]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    if "--sweep" in more:
        return None
    return {n["id"]: n for n in json.loads((out / "report.json").read_text(encoding="utf-8"))["nodes"]}


def first_row(file):
    names, values = rows(file)[:2]
    return dict(zip(names, values))


def selected(voxloom, policy, preset, error, brick=16):
    """A picture of a selection: bricks, promised error, measured RMSE and largest error, the renderer's counters."""
    aware = policy == "lod.transfer-aware"
    sees = "bricks: pyramid.bricks, camera: camera.camera"
    nodes = [("head", "readers.phantom", "", "kind: ct-head, dims: [192, 192, 192], type: u16"),
             ("pyramid", "bricks.pyramid", "volume: head.volume", f"brick: [{brick}, {brick}, {brick}]"),
             ("tf", "scene.transfer", "fit: head.volume", f"preset: {preset}"),
             ("camera", "scene.camera", "fit: head.volume", "azimuth: 40, framing: box, zoom: 1.5"),
             ("detail", policy, sees + (", transfer: tf.transfer" if aware else ""),
              f"size: [320, 320], max_bricks: 1000000, max_error: {error}"),
             ("balanced", "lod.balance", "bricks: pyramid.bricks, selection: detail.selection" + (", transfer: tf.transfer" if aware else ""),
              "max_bricks: 0"),
             ("levels", "lod.statistics", "selection: balanced.selection", ""),
             ("view", "slicer.render", "source: pyramid.bricks, selection: balanced.selection, transfer: tf.transfer, camera: camera.camera",
              "size: [320, 320]"),
             ("full", "slicer.render", "source: head.volume, transfer: tf.transfer, camera: camera.camera", "size: [320, 320]"),
             ("error", "metrics.image", "image: view.image, reference: full.image", "")]
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder)
        report = run_graph(voxloom, out, nodes, ["levels.table", "error.table"])
        run_graph(voxloom, out, nodes, ["view.image"], "--repeat", "4", "--again", "view")
        times = json.loads((out / "report.json").read_text(encoding="utf-8"))["repeats"]["view"]["draw_seconds"]
        levels, of_error = rows(out / "levels.table.csv"), first_row(out / "error.table.csv")
        return {"bricks": int(levels[-1][1]), "promised": float(levels[-1][-1]), "rmse": float(of_error["rmse"]),
                "largest": float(of_error["max_error"]), "draw": min(times[1:]), "view": report["view"]["counters"]}


def promise(voxloom, errors, charts):
    print("| selection | transfer function | asked for | promised, of the peak | bricks | RMSE | RMSE / promised | largest |")
    print("|---|---|---|---|---|---|---|---|")
    panels = {}
    for policy in ("lod.priority", "lod.transfer-aware"):
        for preset in ("materials", "ramp"):
            lines = {"promised": [], "RMSE of the picture": [], "largest error": []}
            for error in errors:
                r = selected(voxloom, policy, preset, error)
                print(f"| `{policy}` | {preset} | {error} | {r['promised']:.4f} | {r['bricks']} | {r['rmse']:.4f} "
                      f"| {r['rmse'] / r['promised']:.2f} | {r['largest']:.3f} |", flush=True)
                for line, value in zip(lines.values(), (r["promised"], r["rmse"], r["largest"])):
                    line.append((error, max(value, 1e-6)))
            panels[f"{policy}, {preset}"] = lines
    write_chart(charts / "lod-promise.svg", panels, "max_error asked for", "error, of the peak", y_log=True)


def phantom(voxloom, dims, volumes):
    """The file of a compressed phantom, made where it is not there yet."""
    volumes.mkdir(parents=True, exist_ok=True)
    file = volumes / f"ct-head-{'x'.join(map(str, dims))}.vxw"
    if not file.exists():
        with tempfile.TemporaryDirectory() as folder:
            run_graph(voxloom, Path(folder),
                      [("head", "readers.phantom", "", f"kind: ct-head, dims: {list(dims)}, type: u16"),
                       ("encoded", "wavelet.encode", "volume: head.volume", "target: psnr, psnr: 50, coder: fast, brick: \"32\", memory: 1000"),
                       ("file", "wavelet.write", "bricks: encoded.bricks", f"path: {file}")], ["file"])
    return file


def sizes(voxloom, all_sizes, volumes, charts):
    """From the middle of a face, 90 degrees, 256 x 256: the scene of the appendix, where a voxel is a pixel 128 voxels away."""
    print("| N | bricks of 32³ | Mvoxels selected | appendix: Mvoxels | MiB decoded | MiB uploaded | prepare, ms | draw, ms | samples, million "
          "| file, MiB | RMSE |")
    print("|---|---|---|---|---|---|---|---|---|---|---|")
    lines = {"Mvoxels selected": [], "appendix, Mvoxels in blocks": [], "10 MiB decoded": [], "MiB uploaded": [], "draw, 10 ms": []}
    for n in all_sizes:
        file = phantom(voxloom, (n, n, n), volumes)
        middle = (n - 1) / 2
        seen = "transfer: tf.transfer, camera: camera.camera"
        nodes = [("open", "wavelet.open", "", f"path: {file}"),
                 # As dense on the way through the volume whatever its size.
                 ("tf", "scene.transfer", "fit: open.bricks",
                  f"preset: ramp, ramp_start: 0.3, ramp_opacity: 0.3, reference_length: {n / 100}"),
                 ("camera", "scene.camera", "fit: open.bricks",
                  f"mode: look-at, eye: [{middle}, 0, {middle}], target: [{middle}, {n}, {middle}], fov: 90")]
        # Finer than a pixel: the reference, where its bricks have room.
        for name, pixels in (("", 1), ("fine", 0.5)):
            nodes += [(f"detail{name}", "lod.projective", "bricks: open.bricks, camera: camera.camera", f"size: [256, 256], pixels: {pixels}"),
                      (f"balanced{name}", "lod.balance", f"bricks: open.bricks, selection: detail{name}.selection", "max_bricks: 0"),
                      (f"view{name}", "slicer.render", f"source: open.bricks, selection: balanced{name}.selection, {seen}",
                       "size: [256, 256], gpu_memory: 2048")]
        nodes += [("levels", "lod.statistics", "selection: balanced.selection", ""),
                  ("error", "metrics.image", "image: view.image, reference: viewfine.image", "")]
        with tempfile.TemporaryDirectory() as folder:
            out = Path(folder)
            report = run_graph(voxloom, out, nodes, ["view.image", "levels.table"])
            cold, levels = report["view"]["counters"], rows(out / "levels.table.csv")
            run_graph(voxloom, out, nodes, ["view.image"], "--repeat", "4", "--again", "view")
            draw = min(json.loads((out / "report.json").read_text(encoding="utf-8"))["repeats"]["view"]["wall_seconds"][1:])
            run_graph(voxloom, out, nodes, ["error.table"])
            rmse = float(first_row(out / "error.table.csv")["rmse"])
        # Layers of as many voxels as pixels, each so far behind the last as its voxels are apart, in blocks of 32.
        far, near, rho = n, 128, 1 + math.sqrt(3) * 2 * 32 / 256
        layers = max(math.log(far / near) / math.log1p(1 / 128), 0)
        appendix = (layers * 65536 * 3.366 + 65536 * 128 / 3) * (rho * rho + rho + 1) / 3 / 1e6
        bricks, voxels = int(levels[-1][1]), float(levels[-1][3]) / 1e6
        decoded, uploaded = cold["bytes decoded"] / 2**20, cold["bytes uploaded"] / 2**20
        print(f"| {n} | {bricks} | {voxels:.1f} | {appendix:.1f} | {decoded:.1f} | {uploaded:.1f} | {cold['prepare ms']:.0f} | {1e3 * draw:.0f} "
              f"| {cold['samples'] / 1e6:.1f} | {file.stat().st_size / 2**20:.2f} | {rmse:.4f} |", flush=True)
        for line, value in zip(lines.values(), (voxels, appendix, decoded / 10, uploaded, 100 * draw)):
            line.append((n, value))
    write_chart(charts / "lod-sizes.svg", {"256 x 256 pixels from the middle of a face of N³": lines}, "N", "", x_ticks=all_sizes,
                legend=220)


def bricks(voxloom):
    print("| brick | bricks | pages | voxels of the selection, million | samples, million | draw, ms | promised | RMSE |")
    print("|---|---|---|---|---|---|---|---|")
    for k in (8, 16, 32):
        r = selected(voxloom, "lod.priority", "ramp", 0.01, k)
        view = r["view"]
        print(f"| {k}³ | {r['bricks']} | {view['pages drawn']:.0f} | {r['bricks'] * k**3 / 1e6:.1f} | {view['samples'] / 1e6:.1f} "
              f"| {1e3 * r['draw']:.0f} | {r['promised']:.4f} | {r['rmse']:.4f} |", flush=True)


def sweep_rows(out):
    table = rows(out / "sweep.csv")
    return [dict(zip(table[0], r)) for r in table[1:]]


def turntable(voxloom, frames, step):
    print("| transfer function | asked for | bricks | largest change: full | selected | RMS change: full | selected "
          "| RMSE | largest error |")
    print("|---|---|---|---|---|---|---|---|---|")
    for preset, error in (("ramp", 0.04), ("ramp", 0.015), ("materials", 0.04), ("materials", 0.015)):
        nodes = [("head", "readers.phantom", "", "kind: ct-head, dims: [192, 192, 192], type: u16"),
                 ("pyramid", "bricks.pyramid", "volume: head.volume", "brick: [16, 16, 16]"),
                 ("tf", "scene.transfer", "fit: head.volume", f"preset: {preset}")]
        outputs = []
        for i in range(frames):
            seen = f"transfer: tf.transfer, camera: camera{i}.camera"
            nodes += [
                (f"camera{i}", "scene.camera", "fit: head.volume", f"azimuth: {40 + i * step}, distance: 0.5, fov: 50"),
                (f"detail{i}", "lod.priority", f"bricks: pyramid.bricks, camera: camera{i}.camera",
                 f"size: [320, 320], max_bricks: 1000000, max_error: {error}"),
                (f"balanced{i}", "lod.balance", f"selection: detail{i}.selection, bricks: pyramid.bricks", "max_bricks: 0"),
                (f"levels{i}", "lod.statistics", f"selection: balanced{i}.selection", ""),
                (f"view{i}", "slicer.render", f"source: pyramid.bricks, selection: balanced{i}.selection, {seen}", "size: [320, 320]"),
                (f"full{i}", "slicer.render", f"source: head.volume, {seen}", "size: [320, 320]"),
                (f"error{i}", "metrics.image", f"image: view{i}.image, reference: full{i}.image", "")]
            outputs += [f"levels{i}.table", f"error{i}.table"]
            for name in ("view", "full") if i else ():
                nodes.append((f"{name}moved{i}", "metrics.image", f"image: {name}{i}.image, reference: {name}{i - 1}.image", ""))
                outputs.append(f"{name}moved{i}.table")
        with tempfile.TemporaryDirectory() as folder:
            out = Path(folder)
            run_graph(voxloom, out, nodes, outputs)

            def most(name, column):
                return max(float(first_row(f)[column]) for f in out.glob(name + "[0-9]*.table.csv"))

            bricks = [int(rows(f)[-1][1]) for f in out.glob("levels*.table.csv")]
            changes = [f"{most(n, c):.4f}" for c in ("max_error", "rmse") for n in ("fullmoved", "viewmoved")]
            print(f"| {preset} | {error} | {min(bricks)} to {max(bricks)} | {' | '.join(changes)} "
                  f"| {most('error', 'rmse'):.4f} | {most('error', 'max_error'):.3f} |", flush=True)


def walk(voxloom, volume, frames, volumes):
    """Through a file of voxels, or a phantom of dims: that is compared with eight times finer bricks, as its whole has no room."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder)
        whole = isinstance(volume, Path)
        file = out / "ct.vxw" if whole else phantom(voxloom, volume, volumes)
        if whole:
            run_graph(voxloom, out, [("ct", "readers.volume", "", f"path: {volume}"),
                                     ("encoded", "wavelet.encode", "volume: ct.volume", "target: psnr, psnr: 50, coder: fast"),
                                     ("file", "wavelet.write", "bricks: encoded.bricks", f"path: {file}")], ["file"])
        print(f"| bricks, error | caches | select, ms | decode, upload, tables, ms | draw, ms | of {'full resolution' if whole else 'the reference'}'s "
              "| bricks drawn | uploaded | families decoded | RMSE, mean | worst |")
        print("|---|---|---|---|---|---|---|---|---|---|---|")
        for most, error in ((512, 32), (1024, 64), (2048, 128)):
            seen = "transfer: tf.transfer, camera: path.camera"
            nodes = [("open", "wavelet.open", "", f"path: {file}"),
                     ("tf", "scene.transfer", "fit: open.bricks", "preset: ct-bone"),
                     ("path", "scene.path", "fit: open.bricks", "mode: walkthrough"),
                     ("detail", "lod.priority", "bricks: open.bricks, camera: path.camera",
                      f"size: [256, 256], max_bricks: {most}, max_error: {1 / error}"),
                     ("balanced", "lod.balance", "selection: detail.selection, bricks: open.bricks", f"max_bricks: {most}"),
                     ("view", "slicer.render", f"source: open.bricks, selection: balanced.selection, {seen}", "size: [256, 256]"),
                     ("fine", "lod.priority", "bricks: open.bricks, camera: path.camera",
                      f"size: [256, 256], max_bricks: 8192, max_error: {1 / error / 8}"),
                     ("full", "slicer.render", f"source: open.bricks, {'' if whole else 'selection: fine.selection, '}{seen}", "size: [256, 256]"),
                     ("error", "metrics.image", "image: view.image, reference: full.image", "")]
            steps = f"path.t=0..1..{1 / (frames - 1)}"
            run_graph(voxloom, out, nodes, ["error.table"], "--sweep", steps)
            errors = [float(first_row(f)["rmse"]) for f in out.glob("error.table.*.csv")]
            both = sweep_rows(out)
            times_full = sum(float(f["view draw seconds"]) for f in both) / sum(float(f["full draw seconds"]) for f in both)
            run_graph(voxloom, out, nodes, ["view.image"], "--sweep", steps)
            warm = sweep_rows(out)[1:]  # the first frame has no caches yet
            # Without caches: each frame by a program of its own.
            cold = []
            for i in range(1, frames):
                nodes[2] = ("path", "scene.path", "fit: open.bricks", f"mode: walkthrough, t: {i / (frames - 1)}")
                report = run_graph(voxloom, out, nodes, ["view.image"])
                frame = {f"{n} {c}": v for n in ("view", "detail", "balanced") for c, v in report[n]["counters"].items()}
                for n in ("view", "detail", "balanced"):
                    frame[f"{n} seconds"] = report[n]["wall_seconds"]
                frame["view draw seconds"] = report["view"]["draw_seconds"]
                cold.append(frame)
            for name, all_frames in (("kept", warm), ("none", cold)):
                def mean(column):
                    return sum(float(f.get(column) or 0) for f in all_frames) / len(all_frames)

                # The transfer function's tables are made once, whatever is drawn.
                print(f"| {most}, 1/{error} | {name} | {1e3 * (mean('detail seconds') + mean('balanced seconds')):.1f} "
                      f"| {mean('view prepare ms') - mean('view table ms'):.1f} | {1e3 * mean('view draw seconds'):.0f} "
                      f"| {times_full:.2f} | {mean('view bricks drawn'):.0f} | {mean('view bricks uploaded'):.0f} | {mean('view families decoded'):.0f} "
                      f"| {sum(errors) / len(errors):.4f} | {max(errors):.4f} |", flush=True)


def plane(voxloom):
    """Tiles of 31 voxels and 4 bytes of 500 x 500 x 250, as theirs; the point of interest lies on the plane, `x` along it."""
    print("| point, factor | nodes | ratio | MiB of tiles | cold, ms | warm, ms | RMSE |")
    print("|---|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder)
        run_graph(voxloom, out, [("head", "readers.phantom", "", "kind: ct-head, dims: [500, 500, 250], type: f32, fit: stretch"),
                                 ("file", "writers.volume", "volume: head.volume", f"path: {out / 'head.nrrd'}")], ["file"])
        fixed = None
        for name, x, factor in (("finest everywhere", 0.5, 1e9), ("middle, 1", 0.5, 1), ("middle, 0.5", 0.5, 0.5),
                                ("edge, 1", 0.0, 1), ("edge, 0.5", 0.0, 0.5)):
            nodes = [("head", "readers.volume", "", f"path: {out / 'head.nrrd'}"),
                     ("pyramid", "bricks.pyramid", "volume: head.volume", "brick: [31, 31, 31], filter: subsample"),
                     ("tf", "scene.transfer", "fit: head.volume", "preset: ramp"),
                     ("camera", "scene.camera", "fit: head.volume", "azimuth: 40, elevation: 60, framing: box")]
            for view, f in (("view", factor), ("full", 1e9)):
                nodes += [(f"cut{view}", "lod.plane", "bricks: pyramid.bricks",
                           f"normal: [0, 1, 2], point: [{x}, 0.5, 0.5], distance_factor: {f:.1f}"),
                          (f"balanced{view}", "lod.balance", f"selection: cut{view}.selection, bricks: pyramid.bricks", "max_bricks: 0"),
                          (view, "slicer.plane", f"source: pyramid.bricks, selection: balanced{view}.selection, "
                           "transfer: tf.transfer, camera: camera.camera", "size: [512, 512], gpu_memory: 128")]
            nodes += [("levels", "lod.statistics", "selection: balancedview.selection", ""),
                      ("error", "metrics.image", "image: view.image, reference: full.image", "")]
            report = run_graph(voxloom, out, nodes, ["view.image", "levels.table"], "--repeat", "4")
            times = json.loads((out / "report.json").read_text(encoding="utf-8"))["repeats"]["view"]["wall_seconds"]
            count = int(rows(out / "levels.table.csv")[-1][1])
            fixed = fixed or count
            tiles = report["view"]["counters"]["bricks resident"]  # with the coarser ones that are mixed in
            run_graph(voxloom, out, nodes, ["error.table"])
            print(f"| {name} | {count} | {fixed / count:.1f} | {tiles * 31**3 * 4 / 2**20:.1f} | {1e3 * times[0]:.0f} "
                  f"| {1e3 * min(times[1:]):.0f} | {float(first_row(out / 'error.table.csv')['rmse']):.4f} |", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("figure", choices=["promise", "sizes", "bricks", "turntable", "walk", "plane"])
    parser.add_argument("--voxloom", default=ROOT / "build/release/bin/voxloom", help="the program to run")
    parser.add_argument("--errors", type=float, nargs="+", default=[0.08, 0.04, 0.02, 0.01, 0.005], help="max_error of promise")
    parser.add_argument("--sizes", type=int, nargs="+", default=[128, 256, 512, 1024, 2048], help="voxels a side of sizes")
    parser.add_argument("--frames", type=int, default=25, help="of turntable and walk")
    parser.add_argument("--step", type=float, default=1, help="degrees between two frames of turntable")
    parser.add_argument("--volume", help="of walk: a file, or X,Y,Z of a phantom; cranium-ct.nrrd of $VOXLOOM_DATA")
    parser.add_argument("--volumes", type=Path, default=ROOT / "out/phantoms", help="folder of compressed phantoms")
    parser.add_argument("--charts", type=Path, default=ROOT / "docs/results", help="folder of charts")
    options = parser.parse_args()
    if options.figure == "promise":
        promise(options.voxloom, options.errors, options.charts)
    elif options.figure == "sizes":
        sizes(options.voxloom, options.sizes, options.volumes, options.charts)
    elif options.figure == "bricks":
        bricks(options.voxloom)
    elif options.figure == "turntable":
        turntable(options.voxloom, options.frames, options.step)
    elif options.figure == "walk":
        volume = options.volume or data_folder() and data_folder() / "cranium-ct.nrrd"
        if not volume:
            parser.error("walk needs --volume, or the real volumes in $VOXLOOM_DATA")
        dims = str(volume).split(",")
        walk(options.voxloom, tuple(map(int, dims)) if len(dims) == 3 else Path(volume), options.frames, options.volumes)
    else:
        plane(options.voxloom)


if __name__ == "__main__":
    main()
