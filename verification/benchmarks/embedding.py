#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""What stepping a scene through the C++, C and Python interfaces costs over `itr run`: instructions of a run less those of a run
of one step, counted by callgrind, one thread. They do not depend on what else the machine does. All have to end at the same
bits; more than 2 % is a failure.

usage: embedding.py [--build build/release]
"""

import argparse
import json
import os
import pathlib
import re
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parents[2]
BAR = 0.02
SCENES = {
    "masticator 2D to t = 1, remeshed": ("examples/masticator.json", {"/time/tend": 1.0}),
    "ball-wall 2D to t = 0.0004, remeshed": ("examples/ball_wall.json", {"/time/tend": 0.0004}),
}
QUIET = {"/output/paraview/skip_frame": 10**6, "/solver/max_threads": 1, "/defaults": "polyfem"}
STEP = """
import json, sys, itr
s = itr.Simulation(itr.Model.from_scene(sys.argv[1], json.loads(sys.argv[2])))
while not s.finished:
    s.step()
sys.stdout.buffer.write(s.positions.tobytes())
"""


def fnv(data):
    h = 14695981039346656037
    for b in data:
        h = ((h ^ b) * 1099511628211) % 2**64
    return f"{h:016x}"


def count(*command, **environment):
    """Instructions of a process, and what it writes."""
    callgrind = ["valgrind", "--tool=callgrind", "--callgrind-out-file=/dev/null"]
    done = subprocess.run([*callgrind, *command], capture_output=True, env={**os.environ, **environment})
    errors = done.stderr.decode()
    if done.returncode:
        sys.exit(f"{command}: {errors}")
    return int(re.search(r"Collected : (\d+)", errors)[1]), done.stdout


def run(build, interface, scene, overrides):
    """Instructions, and a hash of the positions at the end."""
    settings = [f"{pointer}={json.dumps(value)}" for pointer, value in overrides.items()]
    if interface == "Python":
        path = {"PYTHONPATH": str(build / "python"), "PYTHONHASHSEED": "0"}
        instructions, positions = count(sys.executable, "-c", STEP, scene, json.dumps(overrides), **path)
        return instructions, fnv(positions)
    if interface == "itr run":
        import h5py

        with tempfile.TemporaryDirectory() as folder:
            sets = [word for setting in settings for word in ("--set", setting)]
            instructions, _ = count(build / "bin/itr", "run", scene, "-o", f"{folder}/out", "--threads", "1", *sets)
            with h5py.File(sorted(pathlib.Path(folder, "out/frames").glob("*.h5"))[-1]) as file:
                return instructions, fnv(file["fields/x"][()].tobytes())
    instructions, output = count(build / "bin/step_scene", interface, scene, *settings)
    return instructions, output.decode().split()[0]


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--build", type=pathlib.Path, default=ROOT / "build/release")
    build = parser.parse_args().build.resolve()
    worst = 0.0
    for name, (scene, overrides) in SCENES.items():
        path = str(ROOT / scene)
        one_step = {"/time/tend": json.loads(pathlib.Path(path).read_text())["time"]["dt"]}
        instructions, hashes = {}, {}
        for interface in ("itr run", "cpp", "c", "Python"):
            whole, hashes[interface] = run(build, interface, path, {**overrides, **QUIET})
            start, _ = run(build, interface, path, {**overrides, **QUIET, **one_step})
            instructions[interface] = whole - start
        if len(set(hashes.values())) > 1:
            sys.exit(f"{name}: other bits: {hashes}")
        over = {interface: n / instructions["itr run"] - 1 for interface, n in instructions.items()}
        worst = max(worst, *over.values())
        print(f"{name}: " + ", ".join(f"{i} {instructions[i] / 1e6:.1f} M ({over[i]:+.2%})" for i in instructions), flush=True)
    return 1 if worst > BAR else 0


if __name__ == "__main__":
    sys.exit(main())
