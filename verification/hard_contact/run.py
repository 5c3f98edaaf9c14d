#!/usr/bin/python3
# SPDX-License-Identifier: MIT
"""Runs ITR on scenes that make.py wrote, and leaves results as score.py reads them. Scenes that have a result are left out.

python3 verification/hard_contact/run.py SCENES RESULTS [--scene PART-OF-NAME]... [--long] [--limit SECONDS] [--again] [--itr PATH]
python3 verification/hard_contact/run.py --table    writes the tables of README.md from results-*.csv
"""
import argparse
import csv
import json
import math
import pathlib
import subprocess
import sys
import tempfile

import numpy as np

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parent.parent
sys.path.insert(0, str(HERE.parent))
from harness import stored  # noqa: E402


def read_frame(path):
    import h5py
    with h5py.File(path) as file:
        return {"t": float(file.attrs["t"]), "rest": file["mesh/rest"][()], "simplices": file["mesh/simplices"][()],
                "body": file["mesh/body"][()], "x": file["fields/x"][()], "v": file["fields/v"][()]}


def store(frames, folder):
    """One file where all frames have one mesh, else one each."""
    first = frames[0]
    if all(np.array_equal(f["simplices"], first["simplices"]) and np.array_equal(f["rest"], first["rest"]) for f in frames):
        together = {name: np.array([f[name] for f in frames]) for name in ("t", "x", "v")}
        np.savez_compressed(folder / "frames.npz", rest=first["rest"], simplices=first["simplices"], body=first["body"], **together)
        return
    for number, frame in enumerate(frames):
        np.savez_compressed(folder / f"frame{number:06}.npz", **frame)


def forces(path, times):
    """{name: forces on it at the given times} of a run's forces.csv."""
    if not path.exists():
        return {}
    with open(path, newline="") as file:
        rows = list(csv.DictReader(file))
    found = {}
    for row in rows:
        found.setdefault(row["name"], {})[float(row["t"])] = [float(row.get("all_" + axis) or 0) for axis in "xyz"]
    return {name: [series.get(min(series, key=lambda known: abs(known - t))) for t in times] for name, series in found.items()}


def run(scene, folder, options):
    """Runs one scene; returns what result.json has."""
    about = json.loads((scene / "scene.json").read_text())
    with tempfile.TemporaryDirectory() as scratch:
        out = pathlib.Path(scratch) / "out"
        command = [str(options.itr), "run", str(scene / "itr.json"), "-o", str(out), "--threads", "1"]
        try:
            done = subprocess.run(command, capture_output=True, text=True, timeout=options.limit)
            notes = "" if done.returncode == 0 else (done.stderr.strip().splitlines() or ["no words"])[-1]
        except subprocess.TimeoutExpired:
            notes = f"stopped after {options.limit:g} s"
        paths = sorted((out / "frames").glob("*.h5"))
        if not paths:
            return {"code": "ITR", "notes": notes or "no frames"}
        frames = [read_frame(path) for path in paths]
        steps = [json.loads(line) for line in (out / "steps.jsonl").read_text().splitlines()][:len(frames)]
        certified = subprocess.run([str(options.itr), "certify", str(out)], capture_output=True).returncode
        store(frames, folder)
        version = subprocess.run([str(options.itr), "--version"], capture_output=True, text=True).stdout.strip()
        times = [frame["t"] for frame in frames]
        return {"code": "ITR", "version": version, "commit": stored.made("verification/hard_contact/results-itr.csv"),
                "integrator": "none" if about["time"]["quasistatic"] else "implicit Euler",
                "seconds": sum(step.get("processor_seconds", 0) for step in steps),
                "iterations": sum(step.get("newton_iterations", 0) for step in steps),
                "factorizations": sum(step.get("factorizations", 0) for step in steps),
                "certificate": {0: "passed", 4: "failed"}.get(certified, "none"), "notes": notes,
                "contact_energy": [step["energy"]["contact"] for step in steps], "forces": forces(out / "forces.csv", times)}


def run_all(options):
    for scene in sorted(path.parent for path in options.scenes.glob("*/scene.json")):
        chosen = any(part in scene.name for part in options.scene) if options.scene else True
        about = json.loads((scene / "scene.json").read_text())
        folder = options.results / scene.name
        if not chosen or (about["long"] and not options.long) or ((folder / "result.json").exists() and not options.again):
            continue
        folder.mkdir(parents=True, exist_ok=True)
        for old in folder.glob("frame*.npz"):
            old.unlink()
        result = run(scene, folder, options)
        (folder / "result.json").write_text(json.dumps(result) + "\n")
        print(f"{scene.name}: {result.get('seconds', math.nan):.2f} s, {result.get('iterations', '')} iterations, "
              f"{result.get('certificate', 'none')} {result['notes']}", flush=True)


def number(text, form=".2g"):
    return "" if text in ("", "nan") else format(float(text), form)


def table_of(rows):
    lines = ["| scene | verdict | frames | momentum | energy | off / bar | iterations | processor s | own check | why not |",
             "|" + "---|" * 10]
    for r in rows:
        why = "; ".join(part for part in (r["why"].split("; frame")[0], r["notes"]) if part).replace("|", "/")
        lines.append(f"| {r['scene']} | {r['verdict']} | {r['frames']} | {number(r['momentum'])} | {number(r['energy'])} "
                     f"| {number(r['off'])} | {r['iterations']} | {number(r['seconds'])} | {r['certificate']} | {why} |")
    right = sum(r["verdict"] == "right" for r in rows)
    return f"{right} of {len(rows)} right.\n\n" + "\n".join(lines) + "\n"


def write_tables():
    """Each table of README.md is between <!-- CODE --> and <!-- end -->."""
    text = (HERE / "README.md").read_text()
    for path in sorted(HERE.glob("results-*.csv")):
        name = path.stem.removeprefix("results-")
        with open(path, newline="") as file:
            rows = list(csv.DictReader(file))
        before, rest = text.split(f"<!-- {name} -->\n")
        text = f"{before}<!-- {name} -->\n{table_of(rows)}<!-- end -->{rest.split('<!-- end -->', 1)[1]}"
    (HERE / "README.md").write_text(text)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scenes", type=pathlib.Path, nargs="?")
    parser.add_argument("results", type=pathlib.Path, nargs="?")
    parser.add_argument("--scene", action="append")
    parser.add_argument("--long", action="store_true", help="long scenes, too")
    parser.add_argument("--limit", type=float, default=300, help="of a run [s]")
    parser.add_argument("--again", action="store_true", help="scenes that have a result, too")
    parser.add_argument("--itr", type=pathlib.Path, default=ROOT / "build/release/bin/itr")
    parser.add_argument("--table", action="store_true")
    options = parser.parse_args()
    if options.table:
        write_tables()
    elif options.results is None:
        sys.exit("run.py: SCENES and RESULTS are missing")
    else:
        run_all(options)


if __name__ == "__main__":
    main()
