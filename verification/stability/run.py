#!/usr/bin/python3
# SPDX-License-Identifier: MIT
"""Runs the hard cases, judges each, and writes results.csv and table.md.

python3 verification/stability/run.py [--case PART-OF-NAME]... [--build build/release] [--runs DIR] [--results DIR]

A case passes where its run finishes, is certified, drops no remeshing, its energy is bounded, forces and momentum balance, another
solver comes to the same end, and two threads to the same bits. The exit status is 1 if one fails that is not among the KNOWN of
hard_cases.py, or one of these passes.
"""
import argparse
import dataclasses
import json
import math
import os
import pathlib
import shutil
import subprocess
import sys

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parent.parent
sys.path[:0] = [str(HERE.parent), str(HERE)]
import hard_cases as cases  # noqa: E402
import numpy as np  # noqa: E402
from harness import stored  # noqa: E402
from harness.scenes import Run  # noqa: E402
from table import Verdict, number, read, write  # noqa: E402

TIME_LIMIT = 300  # of a run [s]; a limit on processor time would make the kernel count it by ticks
OTHER_SOLVER = "cholmod:supernodal"
CERTIFIED, NOT_CERTIFIED = 0, 4  # exit statuses of `itr certify`
ENERGY_BAR = 1e-6    # growth in a step, by the largest energy of motion, strain and contact so far
# Growth allowed in driven scenes: the forces at the ends of a step bracket its work only where they change one way within it. Over a sharp
# corner they do not: 1.3 % there, 0.005 % in steps half as long.
DRIVEN_ENERGY_BAR = 2e-2
BALANCE_BAR = 1e-3   # of momentum and forces, by the sum of the forces' sizes
AGREEMENT_BAR = 1e-6  # of positions by the scene's extent; where meshes differ, of energies AGREEMENT_OF_ENERGY
AGREEMENT_OF_ENERGY = 1e-2
AGREEMENT_OF_MEAN = 0.1  # of energies over the run, where it is chaotic


def call(build, *arguments):
    """Exit status and the last words of a command; a status of None where it took too long."""
    try:
        done = subprocess.run([str(build / "bin/itr"), *map(str, arguments)], capture_output=True, text=True, timeout=TIME_LIMIT)
    except subprocess.TimeoutExpired:
        return None, f"took more than {TIME_LIMIT} s"
    said = [line for line in done.stderr.splitlines() if line.startswith("itr: ")] or done.stdout.splitlines()[:1] or [""]
    return done.returncode, said[-1].removeprefix("itr: ")


def violations(build, scene, folder):
    """What `itr certify` finds; where nothing touches, bodies may pass through themselves. A certificate that was not made, or
    that fails without a reason, is a violation."""
    done = subprocess.run([str(build / "bin/itr"), "certify", str(folder), "--json"], capture_output=True, text=True)
    if done.returncode not in (CERTIFIED, NOT_CERTIFIED) or not done.stdout.startswith("{"):
        return [f"certify ended with status {done.returncode}: {(done.stderr.strip().splitlines() or ['nothing said'])[-1]}"]
    found = json.loads(done.stdout)
    if found["frames"] != len(frame_paths(folder)):
        return [f"certify saw {found['frames']} of {len(frame_paths(folder))} frames"]
    if (done.returncode == CERTIFIED) != (not found["violations"]):
        return [f"certify ended with status {done.returncode} and named {len(found['violations'])} violations"]
    return [violation["text"] for violation in found["violations"] if scene.contact or violation["of"] != "surfaces"]


def simulate(build, scene, folder, *more):
    shutil.rmtree(folder, ignore_errors=True)
    status, words = call(build, "run", scene.folder / "scene.json", "-o", folder, "--defaults", "polyfem", *more)
    return "" if status == 0 else words or f"exit status {status}"


@dataclasses.dataclass
class Totals:
    """Of a frame."""
    kinetic: float
    momentum: np.ndarray
    force: object  # sum of all forces on the bodies
    size: float    # sum of their sizes
    reaction: np.ndarray | None = None   # of what holds a vertex
    velocity: np.ndarray | None = None   # of the vertices
    touch: object = 0.0                  # sum of contact and friction
    obstacles: np.ndarray | None = None  # positions


def totals(path):
    import h5py
    with h5py.File(path) as file:
        field = lambda name: file["fields/" + name][()] if "fields/" + name in file else None
        forces = {name: field(name + "_force") for name in ("contact", "friction", "reaction")}
        there = [f for f in forces.values() if f is not None]
        touch = [forces[name] for name in ("contact", "friction") if forces[name] is not None]
        return Totals(float(file["totals/kinetic_energy"][()][0]), file["totals/momentum"][()].ravel(),
                      sum(f.sum(axis=0) for f in there) if there else 0.0, sum(np.abs(f).sum() for f in there), forces["reaction"],
                      field("v"), sum(f.sum(axis=0) for f in touch) if touch else 0.0, file["obstacles/x"][()])


def work(before, now, dt):
    """Most that held vertices and obstacles can have put in between two frames: by the forces at either end, if the mesh is one [J].
    NaN where obstacles move unlike each other, since contact forces are known by body only."""
    moved = dt * now.velocity
    most = []
    for end in (before, now):
        if end.reaction is not None and end.reaction.shape == moved.shape:
            most.append(float((end.reaction * moved).sum()))
    done = max(most, default=0.0)
    if len(now.obstacles) and not np.array_equal(now.obstacles, before.obstacles):
        shift = now.obstacles - before.obstacles
        alike = np.abs(shift - shift[0]).max() <= 1e-9 * np.abs(shift).max()
        done += max(float(np.dot(end.touch, shift[0])) for end in (before, now)) if alike else math.nan
    return done


def frame_paths(folder):
    return sorted((folder / "frames").glob("*.h5"))


def energy_growth(scene, steps, states):
    """Largest growth in a step beyond the work of what moves held vertices and obstacles, by what is stored so far."""
    stored_energy = [(0.0 if scene.quasistatic else state.kinetic) + s["energy"]["elastic"] + s["energy"]["contact"]
                     for s, state in zip(steps, states)]
    whole = [own + s["energy"]["body"] for own, s in zip(stored_energy, steps)]
    if not np.isfinite(whole).all():
        return math.nan
    done = [work(a, b, scene.dt) if scene.driven else 0.0 for a, b in zip(states, states[1:])]
    return max((b - a - w) / max(max(np.abs(stored_energy[:k + 2])), 1e-300)
               for k, (a, b, w) in enumerate(zip(whole, whole[1:], done)))


def balance(scene, states):
    """Largest imbalance of a step: change of momentum, contact, friction, what holds, and weight; by the largest so far. A
    projection onto another mesh keeps momentum, so remeshing changes nothing here."""
    weight = np.zeros(scene.dim)
    weight[1] = -scene.gravity * scene.mass
    worst = size = 0.0
    for before, now in zip(states, states[1:]):
        inertia = 0 if scene.quasistatic else (now.momentum - before.momentum) / scene.dt
        size = max(size, now.size + np.abs(weight).sum() + np.abs(inertia).sum())
        if size > 0:
            worst = max(worst, float(np.abs(inertia - now.force - weight).max() / size))
    return worst


def quality(frame):
    """The worst of its cells, deformed."""
    corners = frame.x[frame.cells]
    dim = corners.shape[2]
    volume = np.linalg.det(corners[:, 1:] - corners[:, :1]) / (2 if dim == 2 else 6)
    pairs = [(i, j) for i in range(dim + 1) for j in range(i)]
    edge = np.sqrt(np.mean([((corners[:, i] - corners[:, j])**2).sum(axis=1) for i, j in pairs], axis=0))
    return float((volume / ((math.sqrt(3) / 4 if dim == 2 else math.sqrt(2) / 12) * edge**dim)).min())


def extent(frame):
    return float(np.ptp(frame.x, axis=0).max())


def disagreement(a, b):
    """Of two ends of one scene: positions by the extent, or infinity and the difference of energies where meshes differ."""
    x, y = a.last(), b.last()
    if x.x.shape == y.x.shape and np.array_equal(x.cells, y.cells):
        return float(np.abs(x.x - y.x).max() / extent(x)), None
    return math.inf, relative_difference(*(stored_energies(run)[-1] for run in (a, b)))


def stored_energies(run):
    return np.array([step["energy"]["elastic"] + step["energy"]["contact"] for step in run.steps])


def relative_difference(a, b):
    return abs(a - b) / max(abs(a), abs(b), 1e-300)


def same_bits(a, b):
    import h5py
    first, second = frame_paths(a), frame_paths(b)
    if [p.name for p in first] != [p.name for p in second]:
        return False
    for p, q in zip(first, second):
        with h5py.File(p) as f, h5py.File(q) as g:
            if any(f[name][()].tobytes() != g[name][()].tobytes() for name in ("fields/x", "fields/v", "mesh/simplices")):
                return False
    return True


def judge(name, build, runs):
    """(verdict, run or None, scene)."""
    folder = runs / name
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    scene = cases.build(name, folder)
    verdict = Verdict(name, dim=scene.dim, remeshed=scene.remesh is not None, commit=stored.made("verification/stability/results.csv"))
    failures = []
    if reason := simulate(build, scene, folder / "one", "--threads", 1):
        failures.append("does not finish: " + reason.split("; `itr run`")[0])
    run = None
    if frame_paths(folder / "one"):
        failures += [f"not certified: {words}" for words in violations(build, scene, folder / "one")[:1]]
    if not failures:
        run = Run(folder / "one")
        states = [totals(path) for path in frame_paths(folder / "one")]
        steps = run.steps[1:]
        verdict.steps = len(steps)
        verdict.processor_seconds = sum(s["processor_seconds"] for s in steps)
        distances = [s["min_distance"] for s in steps if s["min_distance"] is not None]
        verdict.min_distance = min(distances) / scene.size if distances else math.nan
        verdict.worst_volume = min(s["min_volume_ratio"] for s in steps)
        verdict.worst_quality = quality(run.last())
        verdict.vertices = steps[-1]["vertices"]
        if reverted := sum(s["reverted_remeshes"] for s in steps):
            failures.append(f"{reverted} times a step's remeshing was dropped")
        verdict.energy_growth = energy_growth(scene, run.steps, states)
        if not verdict.energy_growth <= (DRIVEN_ENERGY_BAR if scene.driven else ENERGY_BAR):
            failures.append(f"energy grows by {verdict.energy_growth:.2g} in a step")
        verdict.balance = balance(scene, states)
        if not verdict.balance <= BALANCE_BAR:
            failures.append(f"forces are off balance by {verdict.balance:.2g}")
        failures += compare_runs(build, scene, folder, run, verdict)
    verdict.failures = "; ".join(failures)
    verdict.passed = not failures
    return verdict, run, scene


def compare_runs(build, scene, folder, run, verdict):
    """Another solver, another number of threads."""
    if reason := simulate(build, scene, folder / "two", "--threads", 2):
        yield "does not finish on two threads: " + reason
    elif not same_bits(folder / "one", folder / "two"):
        yield "two threads give other bits"
    shutil.rmtree(folder / "two", ignore_errors=True)
    if reason := simulate(build, scene, folder / "other", "--threads", 1, "--solver", OTHER_SOLVER):
        yield f"does not finish with {OTHER_SOLVER}: {reason}"
        return
    other = Run(folder / "other")
    verdict.agreement, of_energy = disagreement(run, other)
    of_mean = relative_difference(stored_energies(run).mean(), stored_energies(other).mean())
    shutil.rmtree(folder / "other", ignore_errors=True)
    if not scene.fully_decided:
        return
    if scene.chaotic:
        if not of_mean <= AGREEMENT_OF_MEAN:
            yield f"{OTHER_SOLVER} has another mean energy, {of_mean:.2g} off"
        return
    if of_energy is None and not verdict.agreement <= AGREEMENT_BAR:
        yield f"{OTHER_SOLVER} ends {verdict.agreement:.2g} of the extent away"
    if of_energy is not None and not of_energy <= AGREEMENT_OF_ENERGY:
        yield f"{OTHER_SOLVER} makes another mesh, with an energy {of_energy:.2g} off"


def judge_scales(found):
    """Runs that differ by their size only."""
    for name, (like, to_the_bit) in cases.LIKE.items():
        verdict, run, scene = found.get(name, (None, None, None))
        if verdict is None or run is None:
            continue
        _, other, other_scene = found[like]
        if reason := "nothing to compare with" if other is None else scale_failure(run, scene, other, other_scene, to_the_bit):
            verdict.passed = False
            verdict.failures = "; ".join(filter(None, [verdict.failures, f"{like}: {reason}"]))


def scale_failure(run, scene, other, other_scene, to_the_bit):
    """Why two ends are not alike up to the scale; empty where they are."""
    x, y = run.last(), other.last()
    same_mesh = x.x.shape == y.x.shape and np.array_equal(x.cells, y.cells)
    if to_the_bit:
        return "" if same_mesh and np.array_equal(x.x / scene.size, y.x / other_scene.size) else "other bits"
    if same_mesh:
        off = float(np.abs(x.x / scene.size - y.x / other_scene.size).max() / (extent(y) / other_scene.size))
        return "" if off <= AGREEMENT_BAR else f"ends {off:.2g} of the extent away"
    off = relative_difference(*(stored_energies(r)[-1] / s.size**s.dim for r, s in ((run, scene), (other, other_scene))))
    return "" if off <= AGREEMENT_OF_ENERGY else f"another mesh, with an energy {off:.2g} off"


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--case", action="append", help="only those whose names have this in them")
    parser.add_argument("--build", type=pathlib.Path, default=ROOT / "build/release")
    parser.add_argument("--runs", type=pathlib.Path, default=ROOT / "results/stability")
    parser.add_argument("--results", type=pathlib.Path, default=HERE)
    options = parser.parse_args()
    names = {name for name in cases.CASES if not options.case or any(part in name for part in options.case)}
    names |= {cases.LIKE[name][0] for name in names if name in cases.LIKE}
    names = [name for name in cases.CASES if name in names]
    found = {}
    for name in names:
        found[name] = judge(name, options.build.resolve(), options.runs.resolve())
        verdict = found[name][0]
        print(f"{'ok  ' if verdict.passed else 'FAIL'} {name:28} {number(verdict.processor_seconds):>8} s  {verdict.failures}", flush=True)
    judge_scales(found)
    for name, (verdict, _, _) in found.items():
        if not verdict.passed and name in cases.KNOWN:
            verdict.failures += ". Known: " + cases.KNOWN[name]
    options.results.mkdir(parents=True, exist_ok=True)
    rows = {row.case: row for row in read(options.results / "results.csv")} if (options.results / "results.csv").exists() else {}
    rows |= {name: verdict for name, (verdict, _, _) in found.items()}
    write(options.results, [rows[name] for name in cases.CASES if name in rows])
    unexpected = [name for name, (verdict, _, _) in found.items() if verdict.passed == (name in cases.KNOWN)]
    print(f"{sum(verdict.passed for verdict, _, _ in found.values())} of {len(found)} pass"
          + (f"; not as expected: {', '.join(unexpected)}" if unexpected else ""))
    return 1 if unexpected else 0


if __name__ == "__main__":
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    sys.exit(main())
