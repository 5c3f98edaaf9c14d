#!/usr/bin/python3
# SPDX-License-Identifier: MIT
"""Runs the paper's scenes one after another on one thread, writes results.csv and prints the table of README.md.

python3 verification/paper/run.py [--check] [--itr build/release/bin/itr] [--shared ../shared] [--results DIR]
                                  [--solids] [--curves] [--case PART-OF-NAME]...

With --solids it runs the 3D scenes on uniform levels, with the sizing field and with remeshing, and prints the table that
compares those; it stores nothing. With --curves it runs scenes with linear elements and with curved edges, stores curves.csv
and prints its table. With --check it runs the scenes that have bars (below) and stores nothing; the exit status is 1 if one is missed. Figures of the reference implementation are those of shared/reference-runs.md (its faster column). Every run is certified.
"""
import argparse
import csv
import json
import math
import os
import pathlib
import subprocess
import sys

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parent.parent
sys.path.insert(0, str(HERE.parent))
from harness import stored  # noqa: E402

# name, scene, extra arguments, reference: seconds a step, energy gained by remeshing [J], MB
CASES = [
    ("cantilever", "cantilever/cantilever.json", [], (0.373, 61118, 35)),
    ("cantilever, tolerance 130", "cantilever/cantilever.json", ["/space/remesh/split/acceptance_tolerance=130"], None),
    ("cantilever, swaps and smoothing", "cantilever/cantilever.json",
     ["/space/remesh/swap/enabled=true", "/space/remesh/smooth/enabled=true"], None),
    ("cantilever, uniform n_refs 4", "cantilever/cantilever.json",
     ["/space/remesh/enabled=false", "/geometry/0/n_refs=4"], (0.0145, None, 32)),
    ("masticator h=0.1 to t=4", "masticator/h=0.1.json", ["/time/tend=4"], (None, 298, None)),
    ("masticator h=0.1", "masticator/h=0.1.json", [], (1.40, None, 48)),
    ("masticator h=0.1 fixed mesh", "masticator/h=0.1-noremesh.json", [], (0.0584, None, 40)),
    ("cantilever, swaps and smoothing, the paper's culling", "cantilever/cantilever.json",
     ["/space/remesh/swap/enabled=true", "/space/remesh/smooth/enabled=true", '/space/remesh/screening="energy-percentile"'], None),
    ("masticator h=0.1 to t=4, the paper's culling", "masticator/h=0.1.json",
     ["/time/tend=4", '/space/remesh/screening="energy-percentile"'], None),
    ("ball-wall 2D to t=0.0024, the paper's culling", "ball-wall/2D.json",
     ["/time/tend=0.0024", '/space/remesh/screening="energy-percentile"'], None),
    ("masticator h=0.2", "masticator/h=0.2.json", [], None),
    ("masticator h=0.05 fixed mesh", "masticator/h=0.05.json", [], None),
    ("masticator h=0.05", "masticator/h=0.05.json", ["/space/remesh/enabled=true"], None),
    ("ball-wall 2D to t=0.0024", "ball-wall/2D.json", ["/time/tend=0.0024"], (1.33, 47.2, 202)),
    ("ball-wall 2D", "ball-wall/2D.json", [], None),
    ("ball-wall 2D fixed mesh Newmark", "ball-wall/2D-noremesh.json", ['/time/integrator="ImplicitNewmark"'], None),
    ("ball-wall 2D BDF2", "ball-wall/2D.json", ['/time/integrator="BDF2"'], None),
    ("ball-wall 2D fixed mesh to t=0.0024", "ball-wall/2D-noremesh.json", ["/time/tend=0.0024"], (0.0949, None, 186)),
    ("ball-wall 2D fixed mesh", "ball-wall/2D-noremesh.json", [], None),
    ("shake-rod-y", "shake-rod/shake-rod-y.json", [], None),
    ("spikes2d", "spikes2d/spikes2d.json", [], None),
    ("1-square-dbc", "unit-tests/1-square-dbc.json", [], (0.12, None, 35)),
    ("1-square-dbc fixed mesh", "unit-tests/1-square-dbc-noremesh.json", [], None),
    ("1-square-rotating", "unit-tests/1-square-rotating.json", [], None),
    ("1-square-rotating fixed mesh", "unit-tests/1-square-rotating-noremesh.json", [], None),
    ("1-square-stretch", "unit-tests/1-square-stretch.json", [], None),
    ("sliding", "unit-tests/sliding.json", [], None),
    ("sliding fixed mesh", "unit-tests/sliding-noremesh.json", [], None),
    ("masticator h=0.1 to t=3, swaps and smoothing, tolerance 0.1", "masticator/h=0.1.json",
     ["/time/tend=3", "/space/remesh/swap/enabled=true", "/space/remesh/smooth/enabled=true", "/space/remesh/split/acceptance_tolerance=0.1"],
     None),
    ("masticator h=0.1 to t=3, swaps and smoothing, tolerance 0.023", "masticator/h=0.1.json",
     ["/time/tend=3", "/space/remesh/swap/enabled=true", "/space/remesh/smooth/enabled=true", "/space/remesh/split/acceptance_tolerance=0.023"],
     None),
    ("masticator h=0.1 to t=3, uniform n_refs 2", "masticator/h=0.1.json",
     ["/time/tend=3", "/space/remesh/enabled=false", "/geometry/0/n_refs=2"], None),
    ("masticator h=0.1 to t=3, uniform n_refs 3", "masticator/h=0.1.json",
     ["/time/tend=3", "/space/remesh/enabled=false", "/geometry/0/n_refs=3"], None),
    ("masticator h=0.1, sizing field", "masticator/h=0.1-sizing-field.json", [], None),  # the reference dies in step 56
    ("drop-bar, sizing field", "spikes2d/drop-bar.json", [], (0.2, None, 43)),
    ("ball-wall 3D to t=0.00132", "ball-wall/3D.json", ["/time/tend=0.00132"], (3.47, 0.0161, 311)),
    ("masticator 3D to t=1.1", "masticator/3D.json", ["/time/tend=1.1"], (9.47, 3.22, 227)),
    ("twisting-beam to t=0.2, tolerance 10", "twisting-beam/twisting-beam.json",
     ["/time/tend=0.2", "/space/remesh/split/acceptance_tolerance=10"], (3.61, 2463, 79)),
    ("ball-wall 3D fixed mesh to t=0.0024", "ball-wall/3D-noremesh-nref0.json", ["/time/tend=0.0024"], (1.66, None, 288)),
    ("ball-wall 3D fixed mesh", "ball-wall/3D-noremesh-nref0.json", [], None),
    ("ball-wall 3D fixed mesh, refined, 63 steps", "ball-wall/3D-noremesh-nref1.json", ["/time/tend=0.00126"], (1.44, None, 1007)),
    ("twisting-beam fixed mesh", "twisting-beam/twisting-beam-noremesh-nref0.json", [], (0.100, None, 99)),
    ("twisting-beam fixed mesh, refined, to t=0.5", "twisting-beam/twisting-beam-noremesh-nref1.json", ["/time/tend=0.5"],
     (0.704, None, 236)),
    ("masticator 3D fixed mesh to t=2.6", "masticator/3D-noremesh-nref0.json", ["/time/tend=2.6"], (2.23, None, 209)),
    ("masticator 3D fixed mesh", "masticator/3D-noremesh-nref0.json", [], None),
    ("rollers fixed mesh to t=0.1", "rollers/monkey-soft-hard-noremesh-nref0.json", ["/time/tend=0.1"], (3.39, None, 374)),
    ("spikes3d fixed mesh to t=0.1", "spikes3d/drop-ball-noremesh-nref0.json", ["/time/tend=0.1"], (0.684, None, 389)),
    ("1-cube fixed mesh", "unit-tests/1-cube-noremesh.json", [], None),
    ("1-cube-stretch fixed mesh", "unit-tests/1-cube-stretch-noremesh.json", [], None),
    ("collapse-3D fixed mesh", "unit-tests/collapse-3D-noremesh.json", [], None),
]

# 3D scenes, each on a horizon that its finest uniform level reaches, by every way to a mesh.
SOLIDS = [("ball-wall", "ball-wall/3D.json", ["/time/tend=0.00132"]),
          ("masticator", "masticator/3D.json", ["/time/tend=1.1"]),
          ("twisting-beam, tolerance 10", "twisting-beam/twisting-beam.json",
           ["/time/tend=0.2", "/space/remesh/split/acceptance_tolerance=10"])]
WAYS = [(f"uniform {k}", ["/space/remesh/enabled=false", f"/geometry/0/n_refs={k}"]) for k in range(3)] + [
    ("sizing field", ['/space/remesh/type="sizing_field"']),
    ("remeshed", []),
    ("remeshed, swaps and smoothing", ["/space/remesh/swap/enabled=true", "/space/remesh/smooth/enabled=true"]),
]

# Each as it is, and with curved edges by the same tolerance.
SWAPS = ["/space/remesh/swap/enabled=true", "/space/remesh/smooth/enabled=true"]
NO_SWAPS = [assignment.replace("true", "false") for assignment in SWAPS]
CURVES = [("cantilever", "cantilever/cantilever.json", []),
          ("masticator 2D to t=3", "masticator/h=0.1.json", ["/time/tend=3"]),
          ("ball-wall 2D to t=0.0024", "ball-wall/2D.json", ["/time/tend=0.0024"]),
          ("spikes2d", "spikes2d/spikes2d.json", []),
          ("shake-rod-x", "shake-rod/shake-rod-x.json", []),
          ("shake-rod-y", "shake-rod/shake-rod-y.json", []),
          ("1-square-dbc, edges of 0.005 m and longer", "unit-tests/1-square-dbc.json", ["/space/remesh/split/min_edge_length=0.005"]),
          ("ball-wall 3D to t=0.00132", "ball-wall/3D.json", ["/time/tend=0.00132"]),
          ("masticator 3D to t=1.1", "masticator/3D.json", ["/time/tend=1.1"]),
          ("twisting-beam to t=0.2, tolerance 10", "twisting-beam/twisting-beam.json",
           ["/time/tend=0.2", "/space/remesh/split/acceptance_tolerance=10"]),
          ("rollers to t=0.2", "rollers/monkey-soft-hard.json", ["/time/tend=0.2"]),
          ("spikes3d to t=0.36", "spikes3d/drop-ball.json", ["/time/tend=0.36"])]
# Scenes may have swaps and smoothing themselves.
CURVE_WAYS = [("linear", NO_SWAPS), ("linear, swaps and smoothing", SWAPS), ("curved", ["/space/remesh/curve/enabled=true", *NO_SWAPS]),
              ("curved, swaps and smoothing", ["/space/remesh/curve/enabled=true", *SWAPS])]
OPERATIONS = ("splits", "curves", "straightens", "collapses", "swaps", "smooths")

# Bars of a case: least gain [J] (0.8 of the reference's); energy of the last step [J], at most or (value, relative
# deviation); most vertices there; and most processor seconds a step over those of another case, which neither a slow machine
# nor a busy one changes much.
BARS = {
    "cantilever": {"gain": 48890, "energy": -8.45e6, "vertices": 500, "seconds": ("cantilever, uniform n_refs 4", 12)},
    "cantilever, tolerance 130": {"gain": 48890, "energy": -8.44e6, "vertices": 420},
    "cantilever, uniform n_refs 4": {"energy": (-8.396868278e6, 1e-8)},
    "masticator h=0.1 to t=4": {"gain": 238, "energy": 6785, "vertices": 700, "seconds": ("masticator h=0.1 fixed mesh", 12)},
    "masticator h=0.1 fixed mesh": {},
    # Less than the reference gains (47.2 J), and a lower energy: a mesh that is adapted earlier has less to gain later.
    "ball-wall 2D to t=0.0024": {"gain": 30, "energy": 458.33, "vertices": 1600},
    "masticator h=0.1 to t=3, swaps and smoothing, tolerance 0.1": {"energy": 3125.9, "vertices": 800},
    "masticator h=0.1, sizing field": {"vertices": 700},
    "drop-bar, sizing field": {"vertices": 1400},
    "ball-wall 3D to t=0.00132": {"gain": 0.0161, "vertices": 2800},
    "masticator 3D to t=1.1": {"gain": 3.22, "vertices": 1100},
    "twisting-beam to t=0.2, tolerance 10": {"gain": 2463, "vertices": 1100},
    "ball-wall 2D fixed mesh to t=0.0024": {"energy": (462.161, 1e-5)},
    "1-square-dbc fixed mesh": {"energy": (201.109, 1e-5)},
    "1-square-rotating": {"vertices": 108},
    "1-cube fixed mesh": {"energy": (146.16, 1e-5)},
}


def misses(row, rows):
    """What a row does not reach, in words; `rows` by case."""
    bars, found = BARS.get(row["case"], {}), []
    if not row["finished"] or not row["certified"]:
        found.append("did not finish certified")
    if row["gain"] < bars.get("gain", -math.inf):
        found.append(f"gained {row['gain']:.6g} J, least {bars['gain']:g} J")
    if (energy := bars.get("energy")) is not None:
        value, deviation = energy if isinstance(energy, tuple) else (energy, None)
        off = row["energy_total"] - value
        if not (off <= 0 if deviation is None else abs(off) <= deviation * abs(value)):
            found.append(f"energy {row['energy_total']:.9g} J, bar {value:.9g} J" + (f" to {deviation:g}" if deviation else ""))
    if row["vertices"] > bars.get("vertices", math.inf):
        found.append(f"{row['vertices']} vertices, most {bars['vertices']}")
    if "seconds" in bars:
        other, most = bars["seconds"]
        ratio = row["processor_seconds_per_step"] / rows[other]["processor_seconds_per_step"]
        if not ratio <= most:
            found.append(f"{ratio:.3g} times the processor seconds a step of '{other}', most {most:g}")
    return found


def check(itr, shared, results):
    """Runs the cases that have bars; of each its row and what it misses."""
    options = argparse.Namespace(itr=itr, shared=shared, results=results)
    rows = {case[0]: run(case, options) for case in CASES if case[0] in BARS}
    return [(row, misses(row, rows)) for row in rows.values()]


def counted(step, key, operations=OPERATIONS):
    """A count of a step; builds of earlier commits have no curved edges."""
    return sum(step[operation][key] for operation in operations if operation in step)


def median_trial(steps):
    """Of the steps' medians, each counted as often as the step tried something [s]; 0 where nothing was tried."""
    tried = sorted((s["trial_seconds"], counted(s, "tried")) for s in steps)
    half, so_far = sum(count for _, count in tried) / 2, 0
    for seconds, count in tried:
        so_far += count
        if count and so_far >= half:
            return seconds
    return 0


def folder_of(name, options):
    return options.results / name.replace(" ", "_").replace("=", "").replace("|", "").replace(",", "").replace(".", "").replace("'", "")


def run(case, options):
    name, scene, sets, reference = case
    folder = folder_of(name, options)
    command = [str(options.itr), "run", str(options.shared / "paper-scenes/scripts" / scene), "-o", str(folder), "--overwrite",
               "--threads", "1", "--defaults", "polyfem"]
    for assignment in sets:
        command += ["--set", assignment]
    before = os.times()
    status = subprocess.run(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL).returncode
    processor = os.times().children_user - before.children_user
    certified = subprocess.run([str(options.itr), "certify", str(folder)], stdout=subprocess.DEVNULL).returncode == 0
    lines = [json.loads(line) for line in open(folder / "steps.jsonl")]
    steps = lines[1:]
    last = steps[-1]
    total = sum(s["seconds"]["total"] for s in steps)
    # Writing a frame is not part of a step's work in the reference's figures.
    per_step = (total - sum(s["seconds"]["output"] for s in steps)) / len(steps)
    parts = sum(v for s in steps for k, v in s["seconds"].items() if k != "total")
    touching = [s for s in steps if s["energy"]["contact"] != 0]
    touching_seconds = sum(s["seconds"]["total"] - s["seconds"]["output"] for s in touching)
    row = {
        "case": name, "scene": scene, "set": " ".join(sets), "finished": status == 0, "certified": certified, "steps": len(steps),
        "seconds_per_step": per_step, "processor_seconds_per_step": processor / len(steps), "remesh_share": sum(s["seconds"]["remesh"] for s in steps) / total,
        "parts_over_total": parts / total,
        "contact_steps": len(touching), "seconds_per_contact_step": touching_seconds / len(touching) if touching else None,
        "newton_in_contact": sum(s["newton_iterations"] for s in touching),
        "newton": sum(s["newton_iterations"] for s in steps), "vertices_first": lines[0]["vertices"], "vertices": last["vertices"],
        "energy_total": last["energy"]["total"],
        # The projection's loss lowers the energy, too, but is no gain.
        "gain": sum(s["energy_before_remesh"] - s["energy"]["total"] - s["history_loss"] for s in steps),
        "history_loss": sum(s["history_loss"] for s in steps),
        "trials": sum(counted(s, "relaxed") for s in steps), "accepted": sum(counted(s, "accepted") for s in steps),
        "microseconds_per_trial": 1e6 * median_trial(steps),
        "peak_rss_mb": last["peak_rss_mb"],
        "linear_share": sum(s["seconds"]["linear_solve"] for s in steps) / total,
        "unknowns_mean": sum(s["unknowns"] for s in steps) / len(steps), "unknowns_max": max(s["unknowns"] for s in steps),
        "curved": sum(counted(s, "accepted", ["curves"]) for s in steps),
        "straightened": sum(counted(s, "accepted", ["straightens"]) for s in steps), "tried": sum(counted(s, "tried") for s in steps),
        "reference_seconds": reference[0] if reference else None, "reference_gain": reference[1] if reference else None,
        "reference_mb": reference[2] if reference else None, "commit": stored.made("verification/paper/results.csv"),
    }
    ratio = f"{row['reference_seconds'] / per_step:8.1f}x" if row["reference_seconds"] else " " * 9
    print(f"{name:38} {'ok' if status == 0 else 'STOPPED':8}{'certified' if certified else 'NOT CERTIFIED':14}"
          f"{per_step:9.4f} s/step {ratio}  {row['vertices']:5} vertices  {row['energy_total']:12.6g} J  gain {row['gain']:.4g} J net, {row['history_loss']:.3g} J forgotten",
          flush=True)
    return row


def typed(row):
    """A row of results.csv as `run` makes it."""
    texts = ("case", "scene", "set", "commit")
    return {key: value if key in texts else value == "True" if value in ("True", "False") else None if value == "" else
            float(value) if "." in value or "e" in value else int(value) for key, value in row.items()}


def free_steps(row):
    """Steps at whose end nothing touches: their number, mean seconds and Newton iterations, as the table shows them."""
    touching, free = row["contact_steps"], row["steps"] - row["contact_steps"]
    if not free:
        return "none"
    seconds = row["seconds_per_step"] * row["steps"] - (row["seconds_per_contact_step"] or 0) * touching
    return f"{free}, {seconds / free:.4f}, {row['newton'] - row['newton_in_contact']}"


def table(rows):
    def cell(value, form):
        return "" if value is None else format(value, form)

    lines = ["| scene | end | s/step | reference | ratio | in contact: steps, s/step, iterations | free: steps, s/step, iterations | vertices | energy, last step [J] | gained by remeshing, net [J] | reference, gross "
             "| forgotten [J] | trials / accepted | µs a trial, median | remeshing | MB (reference) |", "|" + "---|" * 16]
    for r in rows:
        ratio = r["reference_seconds"] / r["seconds_per_step"] if r["reference_seconds"] else None
        end = ("finished" if r["finished"] else "stopped") + (", certified" if r["certified"] else ", NOT CERTIFIED")
        touching = f"{r['contact_steps']}, {r['seconds_per_contact_step']:.4f}, {r['newton_in_contact']}" if r["contact_steps"] else "none"
        free = free_steps(r)
        lines.append(
            f"| {r['case']} | {r['steps']} steps, {end} | {r['seconds_per_step']:.4f} | {cell(r['reference_seconds'], '.4g')} "
            f"| {cell(ratio, '.0f' if ratio and ratio >= 10 else '.2g')} | {touching} | {free} | {r['vertices_first']}→{r['vertices']} | {r['energy_total']:.6g} | {r['gain']:.4g} "
            f"| {cell(r['reference_gain'], '.4g')} | {cell(r.get('history_loss'), '.3g')} | {r['trials']} / {r['accepted']} "
            f"| {r['microseconds_per_trial'] if r['trials'] else 0:.0f} | {100 * r['remesh_share']:.0f} % "
            f"| {r['peak_rss_mb']:.0f} ({cell(r['reference_mb'], '.0f')}) |")
    return "\n".join(lines)


def solids_table(rows):
    lines = ["| scene | end | processor s/step | linear solves | MB | unknowns, mean (most) | Newton iterations | bounds / trials / accepted "
             "| energy, last step [J] | gained, net [J] |", "|" + "---|" * 10]
    for r in rows:
        end = ("finished" if r["finished"] else "stopped") + (", certified" if r["certified"] else ", NOT CERTIFIED")
        lines.append(
            f"| {r['case']} | {r['steps']} steps, {end} | {r['processor_seconds_per_step']:.4f} | {100 * r['linear_share']:.0f} % "
            f"| {r['peak_rss_mb']:.0f} | {r['unknowns_mean']:.0f} ({r['unknowns_max']}) | {r['newton']} "
            f"| {r['tried']} / {r['trials']} / {r['accepted']} | {r['energy_total']:.6g} | {r['gain']:.4g} |")
    return "\n".join(lines)


def curves_table(rows):
    lines = ["| scene | edges | end | processor s/step | unknowns, mean (most) | vertices at the end | curved, straightened "
             "| energy, last step [J] |", "|" + "---|" * 8]
    for r in rows:
        scene, _, way = r["case"].partition(" | ")
        end = f"{r['steps']} steps, " + ("finished" if r["finished"] else "stopped")
        end += ", certified" if r["certified"] else ", NOT CERTIFIED"
        lines.append(f"| {scene} | {way} | {end} | {r['processor_seconds_per_step']:.4f} | {r['unknowns_mean']:.0f} "
                     f"({r['unknowns_max']}) | {r['vertices']} | {r['curved']}, {r['straightened']} | {r['energy_total']:.8g} |")
    return "\n".join(lines)


def store(name, rows):
    with open(HERE / name, "w", newline="") as file:
        writer = csv.DictWriter(file, rows[0].keys())
        writer.writeheader()
        writer.writerows(rows)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--itr", type=pathlib.Path, default=ROOT / "build/release/bin/itr")
    parser.add_argument("--shared", type=pathlib.Path, default=ROOT.parent / "shared")
    parser.add_argument("--results", type=pathlib.Path, default=ROOT / "results/paper")
    parser.add_argument("--case", action="append")
    parser.add_argument("--check", action="store_true", help="only the scenes that have bars, against them")
    parser.add_argument("--solids", action="store_true", help="3D scenes: uniform levels, sizing field and remeshing side by side")
    parser.add_argument("--curves", action="store_true", help="scenes with linear elements and with curved edges side by side")
    options = parser.parse_args()
    if options.solids:
        cases = [(f"{name}, {way}", scene, sets + more, None) for name, scene, sets in SOLIDS for way, more in WAYS]
        print(solids_table([run(c, options) for c in cases if not options.case or any(part in c[0] for part in options.case)]))
        return 0
    if options.curves:
        cases = [(f"{name} | {way}", scene, sets + more, None) for name, scene, sets in CURVES for way, more in CURVE_WAYS]
        rows = [run(c, options) for c in cases if not options.case or any(part in c[0] for part in options.case)]
        if not options.case:
            store("curves.csv", rows)
        print(curves_table(rows))
        return 0
    if options.check:
        missed = 0
        for row, found in check(options.itr, options.shared, options.results):
            missed += bool(found)
            print(f"{'FAIL' if found else 'ok  '} {row['case']}" + "".join("; " + what for what in found))
        return 1 if missed else 0
    cases = [c for c in CASES if not options.case or any(part in c[0] for part in options.case)]
    rows = [run(case, options) for case in cases]
    if not options.case:
        store("results.csv", rows)
    print(table(rows))
    return 0 if all(r["finished"] and r["certified"] for r in rows) else 1


if __name__ == "__main__":
    sys.exit(main())
