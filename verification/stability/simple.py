#!/usr/bin/python3
# SPDX-License-Identifier: MIT
"""Runs simple scenes drawn at random and holds each against its right value (README.md, "Simple scenes").

python3 verification/stability/simple.py [--count 2000] [--seed S] [--only K] [--kind KIND] [--itr PATH]
"""
import argparse
import collections
import concurrent.futures
import csv
import dataclasses
import importlib.util
import json
import os
import pathlib
import re
import secrets
import shutil
import signal
import subprocess
import sys
import time
import types

SYSTEM_PYTHON = "/usr/bin/python3"  # Debian's, with numpy, scipy and h5py
if importlib.util.find_spec("h5py") is None and os.path.exists(SYSTEM_PYTHON) and "ITR_REEXECUTED" not in os.environ:
    os.execve(SYSTEM_PYTHON, [SYSTEM_PYTHON, *sys.argv], {**os.environ, "ITR_REEXECUTED": "1"})
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np  # noqa: E402

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parent.parent
sys.path[:0] = [str(HERE), str(HERE.parent)]
import simple_scenes  # noqa: E402
from harness import stored  # noqa: E402

TIME_LIMIT = 120  # seconds of processor time of a run, after which it counts as stopped
VERDICTS = ("right", "said", "wrong without a word", "stopped")
# Advice before the first step speaks of scenes, not of a result that is off.
ADVICE = ("bodies span", "is unusual", "thin, with about", "nu = ", "bodies fall along", "is gravity meant",
          "at the start is below", "d-hat = ", "every vertex is held", "a load acts on the surface", "slivers",
          "have neither inertia nor a held vertex", "stiffness ratio", "edges differ in length", "see above",
          "Newton iterations", "takes its place")


@dataclasses.dataclass
class Row:
    number: int
    kind: str
    verdict: str = ""
    quantity: str = ""      # the one that is off the most, by its bar
    error: float = 0.0
    seconds: float = 0.0
    words: str = ""         # of the warning or the end
    facts: dict = dataclasses.field(default_factory=dict)


class Frame:
    """A stored step."""

    def __init__(self, path):
        import h5py
        with h5py.File(path) as file:
            self.t, self.step = float(file.attrs["t"]), int(file.attrs["step"])
            self.rest, self.u, self.v = file["mesh/rest"][()], file["fields/u"][()], file["fields/v"][()]
            self.reaction = file["fields/reaction_force"][()] if "fields/reaction_force" in file else np.zeros_like(self.u)
            self.momentum = file["totals/momentum"][()].ravel() if "totals/momentum" in file else None
            self.kinetic = float(np.ravel(file["totals/kinetic_energy"][()])[0]) if "totals/kinetic_energy" in file else None


class Outcome:
    """What a run has left: frames, steps, and forces along y (contact, friction and reaction) by name."""

    def __init__(self, folder):
        self.frames = [Frame(path) for path in sorted((folder / "frames").glob("*.h5"))]
        self.steps = [json.loads(line) for line in open(folder / "steps.jsonl")]
        self.forces = collections.defaultdict(list)
        if (folder / "forces.csv").exists():
            with open(folder / "forces.csv") as file:
                for row in csv.DictReader(file):
                    self.forces[row["name"]].append(sum(float(row[f"{of}_y"]) for of in ("contact", "friction", "reaction")))


class ByVertex:
    """What by_vertex.py has left: the last state."""

    def __init__(self, path):
        with np.load(path) as data:
            self.frames = [types.SimpleNamespace(**data)]


def write_msh(path, points, cells, tags, version):
    """A mesh as Gmsh writes it, as text."""
    dim, count = points.shape[1], len(cells)
    flat = np.zeros((len(points), 3))
    flat[:, :dim] = points
    kind = {2: 2, 3: 4}[dim]
    rows = [" ".join(repr(float(x)) for x in p) for p in flat]
    if version == "2.2":
        lines = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat", "$Nodes", str(len(points))]
        lines += [f"{i + 1} {row}" for i, row in enumerate(rows)] + ["$EndNodes", "$Elements", str(count)]
        lines += [f"{i + 1} {kind} 2 {tag} {tag} " + " ".join(str(v + 1) for v in cell)
                  for i, (cell, tag) in enumerate(zip(cells, tags))] + ["$EndElements"]
    else:
        lines = ["$MeshFormat", "4.1 0 8", "$EndMeshFormat", "$Nodes", f"1 {len(points)} 1 {len(points)}",
                 f"{dim} 1 0 {len(points)}"]
        lines += [str(i + 1) for i in range(len(points))] + rows + ["$EndNodes", "$Elements", f"1 {count} 1 {count}",
                                                                     f"{dim} 1 {kind} {count}"]
        lines += [f"{i + 1} " + " ".join(str(v + 1) for v in cell) for i, cell in enumerate(cells)] + ["$EndElements"]
    path.write_text("\n".join(lines) + "\n")


def write_scene(scene, folder, seed, number):
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    for name, (points, cells, tags) in scene.meshes.items():
        write_msh(folder / name, points, cells, tags, "4.1" if (seed + number) % 2 else "2.2")
    (folder / "scene.json").write_text(json.dumps(scene.content, indent=1) + "\n")


def package_beside(itr):
    """The Python package of the same build, or that of this source folder for a copied program."""
    beside = itr.parent.parent / "python"
    return beside if (beside / "itr").exists() else ROOT / "build/release/python"


def run(itr, folder, program=""):
    """Exit status and words; None where it took too long, by processor time: a busy machine does not count against it."""
    scene, out = folder / "scene.json", folder / "out"
    command = [str(itr), "run", str(scene), "-o", str(out), "--overwrite", "--threads", "1"]
    environment = {**os.environ, "OMP_NUM_THREADS": "1"}
    if program:
        command = [sys.executable, str(HERE / program), str(scene), str(folder / "out.npz")]
        environment["PYTHONPATH"] = str(package_beside(itr))
    command = ["prlimit", f"--cpu={TIME_LIMIT}:{TIME_LIMIT + 9}", *command]
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=environment)
    if done.returncode == -signal.SIGXCPU:
        return None, f"no end within {TIME_LIMIT} s"
    return done.returncode, done.stdout + done.stderr


def sayings(words):
    """Warnings that speak of this run."""
    return [line for line in words.splitlines() if re.search(r"\bwarning", line) and not any(a in line for a in ADVICE)]


def judge(scene, outcome, status, words):
    """Verdict, quantity, error and words. A failed run needs no outcome."""
    if status != 0:
        reason = next((line for line in reversed(words.splitlines()) if line.startswith("itr:")), words.strip()[-300:])
        has_reason = status in (2, 3) and scene.may_refuse
        return "said" if has_reason else "stopped", "", float("inf"), reason
    found = [(name, float(error), bar) for name, error, bar in scene.check(outcome)]
    off = [(error / bar if bar else float("inf"), name, error) for name, error, bar in found if not error <= bar]
    said = sayings(words)
    if off:
        _, name, error = max(off, key=lambda row: (row[0] != row[0], row[0]))
        return "said" if said else "wrong without a word", name, error, " | ".join(said[:2])
    name, error, _ = max(found, key=lambda row: row[1] / row[2] if row[2] else 0.0)
    return "right", name, error, " | ".join(said[:2])


def one(arguments):
    """Draws, runs and judges a scene; removes its folder if it is right."""
    seed, number, kind, itr, runs, keep = arguments
    scene = simple_scenes.draw_scene(seed, number, kind)
    folder = runs / f"{number:05d}-{scene.kind}"
    write_scene(scene, folder, seed, number)
    start = time.perf_counter()
    status, words = run(itr, folder, scene.program)
    row = Row(number, scene.kind, seconds=time.perf_counter() - start, facts=scene.facts)
    outcome = None
    if status == 0:
        outcome = ByVertex(folder / "out.npz") if scene.program else Outcome(folder / "out")
    row.verdict, row.quantity, row.error, row.words = judge(scene, outcome, status, words)
    if row.verdict == "right" and not keep:
        shutil.rmtree(folder)
    else:
        (folder / "words.txt").write_text(f"{row.verdict}: {row.quantity} {row.error:.3g}\n{words}")
    return row


def line(row):
    facts = row.facts
    size = " ".join(f"{k}={facts[k]:.3g}" for k in ("size", "E", "dt", "strain", "motion", "gap", "angle", "share") if k in facts)
    kind = f"{row.kind} {facts['dim']}D P{facts['order']} {facts['law']} {facts.get('mode', '')} {facts.get('integrator', '')}"
    kind += " remeshed" if facts.get("remeshed") else ""
    return f"{row.number:5d} {row.verdict:20} {kind} {size}: {row.quantity} {row.error:.2g} {row.words[:160]}"


COLUMNS = ("kind", "scenes", *VERDICTS, "right but warned")


def by_kind(rows):
    """Rows of a table: counts of verdicts by kind, in the order of COLUMNS."""
    for kind in [*sorted({row.kind for row in rows}), "all"]:
        of = [row for row in rows if kind in (row.kind, "all")]
        counts = collections.Counter(row.verdict for row in of)
        yield kind, len(of), *(counts[v] for v in VERDICTS), sum(row.verdict == "right" and bool(row.words) for row in of)


def table(rows):
    lines = [COLUMNS, ["---"] * len(COLUMNS), *by_kind(rows)]
    return "".join("| " + " | ".join(map(str, line)) + " |\n" for line in lines)


def write_results(folder, rows, seed):
    folder.mkdir(parents=True, exist_ok=True)
    commit = stored.made("verification/stability/simple.csv")
    facts = list(dict.fromkeys(key for row in rows for key in row.facts))
    with open(folder / "simple.csv", "w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["seed", "number", "kind", "verdict", "quantity", "error", "seconds", *facts, "words", "commit"])
        for row in rows:
            values = [row.facts.get(key, "") for key in facts]
            writer.writerow([seed, row.number, row.kind, row.verdict, row.quantity, f"{row.error:.3g}", f"{row.seconds:.3f}",
                             *[f"{v:.3g}" if isinstance(v, float) else v for v in values], row.words[:300], commit])
    (folder / "simple.md").write_text(table(rows))


def passed(rows):
    """None stops, none is wrong without a word, 95 of 100 are right."""
    counts = collections.Counter(row.verdict for row in rows)
    return not counts["stopped"] and not counts["wrong without a word"] and counts["right"] >= 0.95 * len(rows)


def drawn(seed, count, itr, runs, jobs=2, kind=None, only=None, keep=False, report=lambda row: None):
    """Rows of scenes that are drawn, run and judged, several at a time."""
    with concurrent.futures.ProcessPoolExecutor(jobs) as pool:
        for row in pool.map(one, [(seed, n, kind, itr, runs, keep) for n in only or range(count)]):
            report(row)
            yield row


def parse():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=2000)
    parser.add_argument("--seed", type=int, help="without it another one each time, which is printed")
    parser.add_argument("--only", type=int, metavar="K", action="append", help="only the scene of this number")
    parser.add_argument("--kind", choices=sorted(simple_scenes.KINDS), help="only scenes of this kind")
    parser.add_argument("--itr", type=pathlib.Path, default=ROOT / "build/release/bin/itr")
    parser.add_argument("--runs", type=pathlib.Path, default=ROOT / "results/simple")
    parser.add_argument("--results", type=pathlib.Path, help="folder for simple.csv and simple.md; default: that of the runs")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--keep", action="store_true", help="folders of scenes that are right, too")
    parser.add_argument("--verbose", action="store_true")
    return parser.parse_args()


def main():
    options = parse()
    options.itr, options.runs = options.itr.resolve(), options.runs.resolve()
    if options.seed is None:
        options.seed = secrets.randbelow(10**6)
    repeat = f"simple.py --seed {options.seed}" + (f" --kind {options.kind}" if options.kind else "") + " --only NUMBER"
    print(f"seed {options.seed}; a scene alone: {repeat}", flush=True)
    start = time.perf_counter()

    def report(row):
        if options.verbose or options.only or row.verdict != "right":
            print(line(row), flush=True)

    rows = list(drawn(options.seed, options.count, options.itr, options.runs, options.jobs, options.kind, options.only,
                      options.keep or options.only, report))
    write_results((options.results or options.runs).resolve(), rows, options.seed)
    print(table(rows) + f"{time.perf_counter() - start:.0f} s; scenes that are not right are in {options.runs}")
    return 0 if passed(rows) else 1


if __name__ == "__main__":
    sys.exit(main())
