#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""What stepping a scene through the C++, C and Python interfaces costs over `itr run`: processor seconds of a run less those
of a run of one step, least of some alternating rounds, one thread. All have to end at the same bits.

usage: embedding.py [--build build/release] [--rounds 5]
"""

import argparse
import json
import os
import pathlib
import resource
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parents[2]
SCENES = {
    "masticator 2D, remeshed": ("examples/masticator.json", {"/time/tend": 2.0}),
    "ball-wall 2D, remeshed": ("examples/ball_wall.json", {"/time/tend": 0.0016}),
}
STEP = """
import json, sys, itr
def fnv(data):
    h = 14695981039346656037
    for b in data:
        h = ((h ^ b) * 1099511628211) % 2**64
    return h
s = itr.Simulation(itr.Model.from_scene(sys.argv[1], json.loads(sys.argv[2])))
while not s.finished:
    s.step()
import time
start = time.process_time()
print(f"{fnv(s.positions.tobytes()):016x} {time.process_time() - start}")
"""


def processor_seconds(command, **environment):
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(command, capture_output=True, text=True, env={**os.environ, **environment})
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if done.returncode:
        sys.exit(f"{command}: {done.stderr}")
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, done.stdout.split()


def run(build, interface, scene, overrides):
    settings = [f"{pointer}={json.dumps(value)}" for pointer, value in overrides.items()]
    if interface == "itr run":
        with tempfile.TemporaryDirectory() as folder:
            sets = [word for setting in settings for word in ("--set", setting)]
            out = f"{folder}/out"
            seconds, _ = processor_seconds([build / "bin/itr", "run", scene, "-o", out, "--threads", "1", *sets])
            import h5py

            frames = sorted(pathlib.Path(out, "frames").glob("*.h5"))
            with h5py.File(frames[-1]) as file:
                return seconds, fnv(file["fields/x"][()].tobytes())
    if interface == "Python":
        command = [sys.executable, "-c", STEP, scene, json.dumps(overrides)]
        seconds, words = processor_seconds(command, PYTHONPATH=str(build / "python"))
        return seconds - float(words[1]), words[0]
    seconds, words = processor_seconds([build / "bin/step_scene", interface, scene, *settings])
    return seconds, words[0]


def fnv(data):
    h = 14695981039346656037
    for b in data:
        h = ((h ^ b) * 1099511628211) % 2**64
    return f"{h:016x}"


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--build", type=pathlib.Path, default=ROOT / "build/release")
    parser.add_argument("--rounds", type=int, default=5)
    arguments = parser.parse_args()
    build = arguments.build.resolve()
    interfaces = ["itr run", "cpp", "c", "Python"]
    quiet = {"/output/paraview/skip_frame": 10**6, "/solver/max_threads": 1}
    for name, (scene, overrides) in SCENES.items():
        path = str(ROOT / scene)
        dt = json.loads(pathlib.Path(path).read_text())["time"]["dt"]
        seconds, hashes = {}, {}
        for _ in range(arguments.rounds):
            for interface in interfaces:
                whole, hashes[interface] = run(build, interface, path, {**overrides, **quiet})
                start, _ = run(build, interface, path, {**overrides, **quiet, "/time/tend": dt})
                seconds[interface] = min(seconds.get(interface, 1e9), whole - start)
        if len(set(hashes.values())) > 1:
            sys.exit(f"{name}: other bits: {hashes}")
        row = [f"{i} {seconds[i]:.3f} s ({seconds[i] / seconds['itr run'] - 1:+.1%})" for i in interfaces]
        print(f"{name}: " + ", ".join(row))


if __name__ == "__main__":
    main()
