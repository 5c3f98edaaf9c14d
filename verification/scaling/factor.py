#!/usr/bin/python3
# SPDX-License-Identifier: MIT
"""What threads make of a factorisation and a solve: cholmod:tasks on one and on two threads beside CHOLMOD, MUMPS on one and
two ranks and Tacho, in turn on dumped systems of the paper's scenes.

python3 verification/scaling/factor.py [--rounds 5] [--system NAME ...] [--work DIR] [--build DIR] [--shared DIR]

Dumps the systems that are not there (minutes), then writes factor.csv (a line a system and solver) and factor.md beside this
file: the least times of all rounds, with the load of the machine. Measure on idle cores.
"""
import argparse
import csv
import json
import os
import pathlib
import subprocess

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parent.parent
FIXED = "/space/remesh/enabled=false"
FALL = '/initial_conditions/velocity=[{"id":2,"value":[0,-2,0]}]'

# Name, scene, every which of its systems is written, and what --set changes. The last one that is written counts.
SYSTEMS = [
    ("masticator 2D", "masticator/h=0.05-noremesh.json", 50, ["/time/tend=0.5"]),
    ("ball-wall 3D", "ball-wall/3D-noremesh-nref0.json", 10, ["/time/tend=0.0008"]),
    ("twisted bar, n_refs 1", "twisting-beam/twisting-beam.json", 25,
     [FIXED, "/geometry/0/n_refs=1", "/time/dt=0.05", "/time/tend=0.2"]),
    ("rollers", "rollers/monkey-soft-hard.json", 50, [FIXED, FALL, "/time/tend=0.05"]),
    ("ball-wall 3D, n_refs 1", "ball-wall/3D-noremesh-nref1.json", 25, ["/time/tend=0.0016"]),
    ("rollers, n_refs 1", "rollers/monkey-soft-hard.json", 10, [FIXED, FALL, "/geometry/0/n_refs=1", "/time/tend=0.02"]),
    ("twisted bar, n_refs 2", "twisting-beam/twisting-beam.json", 5,
     [FIXED, "/geometry/0/n_refs=2", "/time/dt=0.05", "/time/tend=0.05"]),
]
# Label, solver, threads, ranks.
SOLVERS = [("cholmod", "cholmod", 1, 1), ("tasks, 1 thread", "cholmod:tasks", 1, 1), ("tasks, 2 threads", "cholmod:tasks", 2, 1),
           ("mumps:spd", "mumps:spd", 1, 1), ("mumps:spd, 2 ranks", "mumps:spd", 1, 2), ("tacho", "amesos2:tacho", 1, 1)]
KEYS = ["system", "solver", "unknowns", "flops", "analyze_s", "factorize_s", "solve_s", "factorise_work_s", "factorise_span_s",
        "solve_work_s", "solve_span_s", "residual", "load"]
TIMES = [key for key in KEYS if key.endswith("_s")]
ENVIRONMENT = dict(os.environ, OMPI_ALLOW_RUN_AS_ROOT="1", OMPI_ALLOW_RUN_AS_ROOT_CONFIRM="1",
                   OMPI_MCA_rmaps_base_oversubscribe="1")


def dumped(build, shared, work, system):
    """Folder of the system."""
    name, scene, every, sets = system
    folder = work / name.replace(",", "").replace(" ", "-")
    if not any(folder.glob("*/block_size.npy")):
        folder.mkdir(parents=True, exist_ok=True)
        scene = shared / "paper-scenes" / "scripts" / scene
        subprocess.run([build / "bin" / "itr_dump_systems", scene, folder, str(every), "cholmod", *sets], check=True,
                       stdout=subprocess.DEVNULL)
    return [path for path in sorted(folder.glob("[0-9]*")) if (path / "block_size.npy").exists()][-1]


def bench(build, folder, solver, threads, ranks):
    command = [build / "bin" / "itr_solver_bench", folder, solver, "--threads", str(threads)]
    if ranks > 1:
        command = ["mpirun", "-n", str(ranks), *command]
    done = subprocess.run(list(map(str, command)), capture_output=True, text=True, env=ENVIRONMENT)
    return json.loads(done.stdout.splitlines()[-1]) if done.returncode == 0 else None


def measure(build, folder, name, rounds):
    """A row a solver, of the least times of the rounds; their solvers take turns."""
    best = {}
    for _ in range(rounds):
        for label, solver, threads, ranks in SOLVERS:
            row = bench(build, folder, solver, threads, ranks)
            if row is None:
                continue
            row["load"] = os.getloadavg()[0]
            kept = best.setdefault(label, {**row, "system": name, "solver": label})
            for key in TIMES:
                kept[key] = min(kept.get(key, 0), row.get(key, 0))
            kept["load"] = max(kept["load"], row["load"])
    return [best[label] for label, *_ in SOLVERS if label in best]


def table(rows):
    lines = ["Milliseconds of a factorisation + a solve; GFlop/s of the factorisation on one thread; ratios of one thread's times "
             "to two threads', to CHOLMOD's, and of the work of all tasks to the longest chain.", "",
             "| system | unknowns | GFlop | cholmod | tasks, 1 thread | GFlop/s | tasks, 2 threads | 1 : 2 | CHOLMOD : 1 | "
             "work : span | mumps:spd, 1 and 2 ranks | tacho | load |", "|---|" + "---|" * 12]
    for name in dict.fromkeys(row["system"] for row in rows):
        of = {row["solver"]: row for row in rows if row["system"] == name}

        def cell(label):
            row = of.get(label)
            return f"{1e3 * row['factorize_s']:.3g} + {1e3 * row['solve_s']:.3g}" if row else ""

        def ratios(a, b, over="factorize_s", also="solve_s"):
            return f"{a[over] / b[over]:.2f}, {a[also] / b[also]:.2f}"
        one, two, base = of["tasks, 1 thread"], of["tasks, 2 threads"], of["cholmod"]
        lines.append(f"| {name} | {one['unknowns']} | {one['flops'] / 1e9:.3g} | {cell('cholmod')} | {cell('tasks, 1 thread')} | "
                     f"{one['flops'] / one['factorize_s'] / 1e9:.0f} | {cell('tasks, 2 threads')} | {ratios(one, two)} | "
                     f"{ratios(base, one)} | {one['factorise_work_s'] / one['factorise_span_s']:.1f}, "
                     f"{one['solve_work_s'] / one['solve_span_s']:.1f} | {cell('mumps:spd')}; {cell('mumps:spd, 2 ranks')} | "
                     f"{cell('tacho')} | {max(row['load'] for row in of.values()):.1f} |")
    return "\n".join(lines) + "\n"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--system", action="append", help="names that begin so; all where none is given")
    parser.add_argument("--build", type=pathlib.Path, default=ROOT / "build" / "release")
    parser.add_argument("--shared", type=pathlib.Path, default=ROOT.parent / "shared")
    parser.add_argument("--work", type=pathlib.Path, default=ROOT / "results" / "factor", help="for dumped systems")
    parser.add_argument("--to", type=pathlib.Path, default=HERE, help="folder of the results")
    options = parser.parse_args()
    rows = []
    for system in SYSTEMS:
        if options.system is None or any(system[0].startswith(name) for name in options.system):
            folder = dumped(options.build, options.shared, options.work, system)
            rows += measure(options.build, folder, system[0], options.rounds)
            print(table(rows).splitlines()[-1], flush=True)
            with open(options.to / "factor.csv", "w", newline="") as file:
                writer = csv.DictWriter(file, KEYS, extrasaction="ignore")
                writer.writeheader()
                writer.writerows(rows)
            (options.to / "factor.md").write_text(table(rows), encoding="utf-8")


if __name__ == "__main__":
    main()
