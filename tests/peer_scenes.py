#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Runs the regression scenes of shared/peer-scenes and compares with their known norms, each within its own margin.

    python3 tests/peer_scenes.py [--keys] [--only SUBSTRING]... [--itr PATH] [--timeout SECONDS] [--solver NAME]... [--keep DIR]

Scenes run as they are, with PolyFEM's defaults. With --solver all of them run with that engine instead, with several with one
after the other: an engine changes no result.
A scene passes if its five norms of the final displacement (docs/theory.md, "Norms"; linf_grad is wrong in the reference and left out)
are within the margin; `miss` says which norm is off and by how much; `refused` is what `itr` does not support, with its reason;
`stopped` is a simulation that could not go on. Exit status 1 if a scene misses or stops, 0 otherwise.
"""
import argparse
import json
import pathlib
import subprocess
import sys
import tempfile
import time

HERE = pathlib.Path(__file__).resolve().parent
NORMS = ("l2", "h1", "h1_semi", "linf", "lp")
DEFAULT_MARGIN = 1e-5
LISTS = ("scenes.txt", "scenes-p2.txt")
ALSO = ("contact/examples/3D/unit-tests/erleben/wedges.json",)  # known norms that the list leaves out


def list_scenes(folder):
    listed = [scene for name in LISTS for scene in (folder / name).read_text().split()]
    return listed + [scene for scene in ALSO if scene not in listed]


def merge(base, changes):
    """RFC 7396."""
    if not isinstance(base, dict) or not isinstance(changes, dict):
        return changes
    result = dict(base)
    for key, value in changes.items():
        if value is None:
            result.pop(key, None)
        else:
            result[key] = merge(result.get(key), value) if isinstance(value, dict) else value
    return result


def read_merged(path):
    """The scene with its common files below it; JSON patches aside, they do not touch time or tests."""
    scene = json.loads(path.read_text())
    common = scene.pop("common", "")
    return merge(read_merged(path.parent / common), scene) if common else scene


def time_override(scene):
    """What `tests/time_steps` makes of the time of a merged scene: a value for /time, or None to leave it."""
    steps = scene.get("tests", {}).get("time_steps", 1)
    if "time" not in scene or steps in ("all", "static"):
        return None
    times = dict(scene["time"])
    if "dt" not in times:
        times["dt"] = times["tend"] / times["time_steps"]
    times.pop("tend", None)
    times["time_steps"] = steps
    return times


def compare(reference, norms):
    """Largest deviation over its margin, with the name of the norm."""
    margin = reference.get("margin", DEFAULT_MARGIN)
    deviations = []
    for name in NORMS:
        expected = reference["err_" + name]
        relative = abs(norms[name] - expected) / max(abs(expected), 1e-5)
        deviations.append((relative / margin, name, relative, margin))
    return max(deviations)


def run(scene_file, solver, args):
    """(status, detail, seconds) of one scene, by the solver that it names where none is given."""
    override = time_override(read_merged(scene_file))
    reference = json.loads(scene_file.read_text())["tests"]
    with tempfile.TemporaryDirectory() as scratch:
        folder = pathlib.Path(args.keep) / scene_file.stem if args.keep else pathlib.Path(scratch)
        command = [args.itr, "run", str(scene_file), "-o", str(folder), "--overwrite", "--threads", "1", "--defaults", "polyfem"]
        command += ["--solver", solver] if solver else []
        command += ["--set", "/output/paraview/skip_frame=1000000"]
        if override:
            command += ["--set", "/time=" + json.dumps(override)]
        start = time.monotonic()
        try:
            done = subprocess.run(command, capture_output=True, text=True, timeout=args.timeout)
        except subprocess.TimeoutExpired:
            return "stopped", f"no end within {args.timeout:g} s", args.timeout
        seconds = time.monotonic() - start
        reason = next((line for line in done.stderr.splitlines() if line.startswith("itr:")), "no message")
        if done.returncode == 2:
            return "refused", reason.removeprefix("itr: ").replace(str(scene_file), scene_file.name), seconds
        if done.returncode != 0:
            return "stopped", reason, seconds
        norms = json.loads((folder / "summary.json").read_text())["norms"]
    ratio, name, relative, margin = compare(reference, norms)
    detail = f"{name} off by {relative:.1e}, margin {margin:.0e}"
    return ("pass" if ratio <= 1 else "miss"), detail, seconds


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--itr", default=HERE.parent / "build/release/bin/itr")
    parser.add_argument("--scenes", type=pathlib.Path, default=HERE.parent.parent / "shared/peer-scenes")
    parser.add_argument("--only", action="append", help="scenes whose path contains this; several: any of them")
    parser.add_argument("--keys", action="store_true", help="run the scenes of scenes-keys.txt, some of which are refused, instead")
    parser.add_argument("--timeout", type=float, default=300, help="for one scene [s]")
    parser.add_argument("--solver", action="append", help="in place of the one that a scene names; several: each of them")
    parser.add_argument("--keep", help="folder for the results, which are otherwise dropped")
    args = parser.parse_args()
    counts = {}
    print("| scene | result | seconds | detail |\n|---|---|---|---|")
    for solver in args.solver or [None]:
        for line in (args.scenes / "scenes-keys.txt").read_text().split() if args.keys else list_scenes(args.scenes):
            if args.only and not any(part in line for part in args.only):
                continue
            status, detail, seconds = run(args.scenes / line, solver, args)
            counts[status] = counts.get(status, 0) + 1
            name = line.removeprefix("contact/examples/").removesuffix(".json") + (f", {solver}" if solver else "")
            print(f"| {name} | {status} | {seconds:.1f} | {detail} |", flush=True)
    print("\n" + ", ".join(f"{count} {status}" for status, count in sorted(counts.items())))
    return 1 if counts.get("miss") or counts.get("stopped") else 0


if __name__ == "__main__":
    sys.exit(main())
