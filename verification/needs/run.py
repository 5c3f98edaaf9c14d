#!/usr/bin/python3
# SPDX-License-Identifier: MIT
"""The paper's scenes with every term, operation and output on, against what `itr explain` chose. Writes results.csv and table.md.

python3 verification/needs/run.py [--case PART-OF-NAME]... [--page] [--itr build/release/bin/itr] [--shared ../shared] [--runs DIR]

What a scene does not need is asked for with a coefficient of 1e-300: its terms are assembled, searched and evaluated, and add nothing.
Operations of the remesher are asked for with a tolerance of 1e300 J: every edge is tried, and none is accepted that the scene does
not accept. So results are to be the same. Both runs alternate REPEATS times, and the least processor seconds of each count.
--page runs nothing.
"""
import argparse
import csv
import dataclasses
import json
import math
import pathlib
import subprocess
import sys

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parent.parent
sys.path.insert(0, str(HERE.parent))
from harness import stored  # noqa: E402

REPEATS = 2
NOTHING, NEVER = "1e-300", "1e300"

# name: scene, overrides of both runs. Sliding: with one round of friction a scene that is solved twice a step, as where remeshing
# looks for something, slides otherwise.
SCENES = {
    "cantilever": ("cantilever/cantilever.json", []),
    "1-square-dbc": ("unit-tests/1-square-dbc.json", []),
    "1-square-rotating": ("unit-tests/1-square-rotating.json", []),
    "sliding": ("unit-tests/sliding.json", ["/solver/contact/friction_iterations=50"]),
    "cantilever, fixed mesh": ("cantilever/cantilever.json", ["/space/remesh/enabled=false"]),
    "1-square-dbc, fixed mesh": ("unit-tests/1-square-dbc-noremesh.json", []),
    "sliding, fixed mesh": ("unit-tests/sliding-noremesh.json", ["/solver/contact/friction_iterations=50"]),
    "masticator 2D to t = 1": ("masticator/h=0.1.json", ["/time/tend=1"]),
    "masticator 2D, fixed mesh": ("masticator/h=0.1-noremesh.json", ["/time/tend=3"]),
    "ball-wall 2D to t = 1.2 ms": ("ball-wall/2D.json", ["/time/tend=0.0012"]),
    "shake-rod-y to t = 0.3": ("shake-rod/shake-rod-y.json", ["/time/tend=0.3"]),
    "spikes2d, fixed mesh, to t = 0.5": ("spikes2d/spikes2d-noremesh.json", ["/time/tend=0.5"]),
    "1-cube, fixed mesh": ("unit-tests/1-cube-noremesh.json", []),
    "1-cube-stretch, fixed mesh": ("unit-tests/1-cube-stretch-noremesh.json", []),
    "twisting-beam to t = 0.05": ("twisting-beam/twisting-beam.json", ["/time/tend=0.05", "/space/remesh/split/acceptance_tolerance=10"]),
    "twisting-beam, fixed mesh, to t = 0.1": ("twisting-beam/twisting-beam-noremesh-nref0.json", ["/time/tend=0.1"]),
    "masticator 3D to t = 1.1": ("masticator/3D.json", ["/time/tend=1.1"]),
    "ball-wall 3D, fixed mesh, to t = 0.3 ms": ("ball-wall/3D-noremesh-nref0.json", ["/time/tend=0.0003"]),
    "rollers, fixed mesh, to t = 0.02": ("rollers/monkey-soft-hard-noremesh-nref0.json", ["/time/tend=0.02"]),
    "spikes3d, fixed mesh, to t = 0.02": ("spikes3d/drop-ball-noremesh-nref0.json", ["/time/tend=0.02"]),
}
TERMS = ("inertia", "elastic", "body", "pressure", "damping", "contact", "friction", "remeshing")


@dataclasses.dataclass
class Row:
    scene: str
    terms: str = ""        # that `explain` has
    added: str = ""        # beside them
    unknowns: str = ""     # of the first step, and of all vertices
    seconds: float = math.nan      # processor seconds of the steps, as chosen
    seconds_all: float = math.nan  # with everything
    memory: float = math.nan       # [MB]
    memory_all: float = math.nan
    difference: float = math.nan   # of the last positions, by the extent; infinity where meshes differ
    energy_difference: float = math.nan  # of the last step's potential, relative
    failure: str = ""
    commit: str = ""


def explained(itr, scene, sets):
    """Terms that are in, and what `explain` says of unknowns."""
    text = subprocess.run([str(itr), "explain", str(scene), "--defaults", "polyfem", *sets], capture_output=True, text=True, check=True).stdout.splitlines()
    rows = [line.split() for line in text[text.index("energy terms") + 1:text.index("energy terms") + 1 + len(TERMS)]]
    return [row[0] for row in rows if row[1] == "yes"], text[text.index("unknowns") + 1].strip().split("(")[0].strip()


def everything(dim, terms, has_remeshing):
    """Overrides that ask for what the scene does not have."""
    sets = []
    if "body" not in terms:
        sets.append(f"/boundary_conditions/rhs={json.dumps([0] * (dim - 1) + [1e-300])}")
    if "pressure" not in terms:
        sets.append('/boundary_conditions/pressure_boundary=[{"id": 1, "value": %s}]' % NOTHING)
    if "damping" not in terms:
        sets.append('/solver/rayleigh_damping=[{"form": "elasticity", "stiffness": %s}, {"form": "contact", "stiffness": %s}]'
                    % (NOTHING, NOTHING))
    if "contact" not in terms:
        sets.append("/contact/enabled=true")
    if "friction" not in terms:
        sets += [f"/contact/friction_coefficient={NOTHING}", "/solver/contact/friction_iterations=1"]
    operations = ("swap", "smooth") if has_remeshing else ("split", "collapse", "swap", "smooth")
    sets.append("/space/remesh/enabled=true")
    sets += [f"/space/remesh/{one}/{key}" for one in operations for key in ("enabled=true", f"acceptance_tolerance={NEVER}")]
    sets += [f"/output/paraview/options/{name}=true" for name in ("contact_forces", "friction_forces", "reaction_forces",
                                                                  "scalar_values", "tensor_values", "kinetic_energy", "momentum")]
    return sets


def run(itr, scene, sets, folder):
    """Steps of a run, or why there are none."""
    done = subprocess.run([str(itr), "run", str(scene), "-o", str(folder), "--overwrite", "--threads", "1", "--defaults", "polyfem",
                           *sets], capture_output=True, text=True)
    if done.returncode != 0:
        return None, done.stderr.strip().splitlines()[-1][:200]
    return [json.loads(line) for line in open(folder / "steps.jsonl")], ""


def last_frame(folder):
    import h5py
    with h5py.File(max((folder / "frames").glob("*.h5"))) as file:
        return file["fields/x"][()], file["mesh/simplices"][()]


def measure(name, options):
    import numpy as np
    scene, sets = SCENES[name]
    scene = options.shared / "paper-scenes/scripts" / scene
    own = [word for one in sets for word in ("--set", one)]
    terms, unknowns = explained(options.itr, scene, own)
    row = Row(name, " ".join(terms), " ".join(term for term in TERMS if term not in terms and term != "inertia"), unknowns,
              commit=stored.made("verification/needs/results.csv"))
    folders = [options.runs / name.replace(" ", "_") / kind for kind in ("chosen", "everything")]
    dim = 3 if "3D" in scene.name or scene.parent.name in ("twisting-beam", "rollers", "spikes3d") or "cube" in scene.name else 2
    more = own + [word for one in everything(dim, terms, "remeshing" in terms) for word in ("--set", one)]
    times, memory = ([], []), ([], [])
    for _ in range(REPEATS):
        for k, arguments in enumerate((own, more)):
            steps, row.failure = run(options.itr, scene, arguments, folders[k])
            if steps is None:
                return row
            times[k].append(sum(s["processor_seconds"] for s in steps[1:]))
            memory[k].append(max(s["peak_rss_mb"] for s in steps))
            if k == 0:
                total = steps[-1]["energy"]["total"]
    row.seconds, row.seconds_all = map(min, times)
    row.memory, row.memory_all = map(min, memory)
    row.energy_difference = abs(steps[-1]["energy"]["total"] - total) / max(abs(total), 1e-300)
    (x, cells), (y, other_cells) = map(last_frame, folders)
    same = x.shape == y.shape and np.array_equal(cells, other_cells)
    row.difference = float(np.abs(x - y).max() / np.ptp(x, axis=0).max()) if same else math.inf
    return row


def read(path):
    with open(path, newline="") as file:
        return [Row(**{f.name: f.type(row[f.name]) for f in dataclasses.fields(Row)}) for row in csv.DictReader(file)]


def table(rows):
    lines = ["| scene | terms it has | added | unknowns | processor s | with everything | | MB | with everything | positions differ by, of the "
             "extent | energy |", "|" + "---|" * 11]
    for r in rows:
        if r.failure:
            lines.append(f"| {r.scene} | {r.terms} | {r.added} | {r.unknowns} | | failed: {r.failure} | | | | | |")
            continue
        differ = "another mesh" if math.isinf(r.difference) else "same bits" if r.difference == 0 else f"{r.difference:.1e}"
        lines.append(f"| {r.scene} | {r.terms} | {r.added} | {r.unknowns} | {r.seconds:.3g} | {r.seconds_all:.3g} "
                     f"| {r.seconds_all / r.seconds:.2g} | {r.memory:.0f} | {r.memory_all:.0f} | {differ} | {r.energy_difference:.1e} |")
    return "\n".join(lines) + "\n"


def write(path, rows):
    with open(path, "w", newline="") as file:
        writer = csv.DictWriter(file, [f.name for f in dataclasses.fields(Row)], lineterminator="\n")
        writer.writeheader()
        writer.writerows(dataclasses.asdict(row) for row in rows)
    (HERE / "table.md").write_text(table(rows))


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--case", action="append", help="only those whose names have this in them")
    parser.add_argument("--page", action="store_true", help="run nothing")
    parser.add_argument("--itr", type=pathlib.Path, default=ROOT / "build/release/bin/itr")
    parser.add_argument("--shared", type=pathlib.Path, default=ROOT.parent / "shared")
    parser.add_argument("--runs", type=pathlib.Path, default=ROOT / "results/needs")
    options = parser.parse_args()
    path = HERE / "results.csv"
    rows = {row.scene: row for row in read(path)} if path.exists() else {}
    for name in [] if options.page else SCENES:
        if options.case and not any(part in name for part in options.case):
            continue
        rows[name] = measure(name, options)
        print(table([rows[name]]).splitlines()[2], flush=True)
        write(path, [rows[name] for name in SCENES if name in rows])
    found = [rows[name] for name in SCENES if name in rows]
    write(path, found)
    return 0 if all(not row.failure for row in found) else 1


if __name__ == "__main__":
    sys.exit(main())
