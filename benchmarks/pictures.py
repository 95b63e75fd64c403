"""What the Python benchmarks share: graphs drawn by bench-pictures, and errors of pictures."""

import json
import math
import os
import pathlib
import subprocess
import sys

import numpy as np

from data import SOURCE, data_folder


def yaml(value):
    """A parameter's value in one line of YAML, which JSON is."""
    return json.dumps(value)


def graph_text(nodes, outputs):
    """nodes: {id: (type, {port: wire}, {parameter: value})}."""
    lines = ["voxloom: 1", f"outputs: [{', '.join(outputs)}]", "nodes:"]
    for name, (kind, wires, params) in nodes.items():
        lines += [f"  - id: {name}", f"    type: {kind}"]
        if wires:
            lines.append("    in: { " + ", ".join(f"{k}: {v}" for k, v in wires.items()) + " }")
        if params:
            lines.append("    set: { " + ", ".join(f"{k}: {yaml(v)}" for k, v in params.items()) + " }")
    return "\n".join(lines) + "\n"


class Drawer:
    """Runs graphs through a build's bench-pictures."""

    def __init__(self, build, folder):
        self.program = pathlib.Path(build) / "bin" / "bench-pictures"
        self.plugins = pathlib.Path(build) / "lib" / "voxloom" / "plugins"
        self.folder = pathlib.Path(folder)
        if not self.program.exists():
            sys.exit(f"{self.program} is not there; build it with: "
                     f"cmake --build {build} --target bench-pictures")

    def has(self, plugin):
        return (self.plugins / f"{plugin}.so").exists()

    def draw(self, name, nodes, outputs, timed=(), repeat=9, warm_up=2):
        """{"values": {"node.port": ...}, "times": {"node": {"wall": [s], "draw": [s], "cpu": [s]}}}"""
        self.folder.mkdir(parents=True, exist_ok=True)
        graph = self.folder / f"{name}.yaml"
        graph.write_text(graph_text(nodes, outputs))
        command = [str(self.program), str(graph), str(self.folder / name), "--repeat", str(repeat),
                   "--warm-up", str(warm_up)]
        for node in timed:
            command += ["--time", node]
        environment = dict(os.environ, VOXLOOM_PLUGIN_PATH=str(self.plugins))
        done = subprocess.run(command, capture_output=True, text=True, env=environment)
        if done.returncode != 0:
            sys.exit(f"{graph} could not be drawn:\n{done.stderr}")
        return json.loads(done.stdout.splitlines()[-1])


def picture(result, value):
    """The picture as it is shown: [y, x, rgb], clamped to what a screen can show."""
    return np.load(result["values"][value]["file"])[:, :, :3].astype(float).clip(0, 1)


def in_8_bits(image):
    return np.round(image * 255) / 255


def errors(image, truth):
    """RMSE, PSNR in dB for peak 1, and largest difference, over red, green and blue."""
    difference = image - truth
    rmse = float(np.sqrt(np.mean(difference ** 2)))
    return rmse, math.inf if rmse == 0 else -20 * math.log10(rmse), float(np.abs(difference).max())
