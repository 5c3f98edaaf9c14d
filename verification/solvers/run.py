#!/usr/bin/python3
# SPDX-License-Identifier: MIT
"""What the choice of a linear solver costs: dumps Newton systems of scenes at several sizes, solves each with every solver
that is there (a process each, with a limit of time and memory), then runs scenes from end to end with each, factors used
again and not, and writes results.csv, end_to_end.csv, the tables of README.md and a plot.

python3 verification/solvers/run.py [--build build/release] [--work DIR] [--seconds 1200] [--gib 16] [--scene NAME]...
"""
import argparse
import csv
import itertools
import json
import math
import os
import pathlib
import resource
import signal
import subprocess
import sys

import numpy

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parent.parent
SHARED = ROOT.parent / "shared" / "paper-scenes" / "scripts"
sys.path.insert(0, str(HERE.parent))
from harness import stored  # noqa: E402


# Starts close above the spikes or rollers with the speed of the fall, to be in contact after a few steps.
FIXED = "/space/remesh/enabled=false"
BALL = [FIXED, "/geometry/1/transformation/translation=[0.9,1.485,0.9]",
        '/initial_conditions/velocity=[{"id":2,"value":[0,-3.2,0]}]', "/time/tend=0.05"]
MONKEY = [FIXED, '/initial_conditions/velocity=[{"id":2,"value":[0,-2,0]}]', "/time/tend=0.1"]
MULTIGRID = '/solver/linear/solver="belos:muelu"'  # to get to a system of 300 000 unknowns in minutes
# name, scene, --set for all sizes, --set for each size; the last system that is written counts
SCENES = [
    ("bar-twist 3D", SHARED / "twisting-beam" / "twisting-beam.json", [FIXED, "/time/dt=0.05", "/time/tend=0.2"],
     (["/geometry/0/n_refs=1"], ["/geometry/0/n_refs=2"], ["/geometry/0/n_refs=3", MULTIGRID])),
    ("ball on spikes 3D", SHARED / "spikes3d" / "drop-ball.json", BALL,
     ([], ["/geometry/1/n_refs=1"], ["/geometry/0/n_refs=1", "/geometry/1/n_refs=2", MULTIGRID])),
    ("monkey on rollers 3D", SHARED / "rollers" / "monkey-soft-hard.json", MONKEY,
     ([], ["/geometry/0/n_refs=1"], ['/geometry/0/mesh="monkey18K_u.msh"', "/geometry/0/n_refs=1", MULTIGRID])),
    ("masticator 2D", ROOT / "examples" / "masticator.json", [FIXED, "/time/dt=0.5", "/time/tend=2"],
     (["/geometry/0/n_refs=2"], ["/geometry/0/n_refs=4"], ["/geometry/0/n_refs=5"])),
]
# the same scenes from end to end, at their first size (the masticator with remeshing): name, --set
ENDS = {"masticator 2D": ["/time/tend=3"], "bar-twist 3D": [FIXED, "/time/dt=0.05", "/time/tend=0.5", "/geometry/0/n_refs=1"],
        "ball on spikes 3D": [*BALL, "/time/tend=0.01"], "monkey on rollers 3D": [*MONKEY, "/time/tend=0.03"]}
DENSE_MOST = 10_000  # unknowns: `dense` is for patches
ITERATIVE = ("belos:muelu", "eigen:cg")  # have no factors to use again
END_KEYS = ["scene", "solver", "reuse", "outcome", "steps", "newton_iterations", "linear_solves", "factorizations",
            "linear_iterations", "total_s", "linear_s", "energy", "commit"]
KEYS = ["scene", "solver", "ranks", "unknowns", "nonzeros", "outcome", "analyze_s", "factorize_s", "solve_s",
        "bare_factorize_s", "bare_solve_s", "overhead", "factor_nonzeros", "factor_mb", "largest_rank_mb", "flops", "iterations",
        "residual", "commit"]
ENVIRONMENT = dict(os.environ, OMPI_ALLOW_RUN_AS_ROOT="1", OMPI_ALLOW_RUN_AS_ROOT_CONFIRM="1",
                   OMPI_MCA_rmaps_base_oversubscribe="1")


def dump(itr, scene, sets, folder, seconds):
    """The folder of the last system that a scene's run solved before its time was over, or None."""
    if not any(folder.glob("*/values.npy")):
        command = [itr, "run", scene, "-o", folder / "run", "--overwrite", "--dump-systems", folder, "--dump-every", "5",
                   "--defaults", "polyfem"]
        for value in ['/solver/linear/solver="auto"', *sets]:
            command += ["--set", value]
        folder.mkdir(parents=True, exist_ok=True)
        with open(folder / "log", "w", encoding="utf-8") as log:
            try:
                subprocess.run(list(map(str, command)), stdout=log, stderr=log, timeout=seconds, check=False)
            except subprocess.TimeoutExpired:
                pass
    whole = [path for path in sorted(folder.glob("[0-9]*")) if (path / "block_size.npy").exists()]  # written last
    return whole[-1] if whole else None


def limited(command, seconds, gib):
    """Runs a command that has so many seconds of CPU on one thread, half as many again of wall time, and so much memory."""
    def limit():
        resource.setrlimit(resource.RLIMIT_CPU, (math.ceil(seconds),) * 2)
        resource.setrlimit(resource.RLIMIT_AS, (int(gib * 2**30),) * 2)
    try:
        done = subprocess.run(list(map(str, command)), capture_output=True, text=True, timeout=1.5 * seconds,
                              preexec_fn=limit, env=ENVIRONMENT, check=False)
    except subprocess.TimeoutExpired:
        return None, f"did not finish in {seconds / 60:g} min"
    if done.returncode in (-signal.SIGKILL, -signal.SIGXCPU):  # the first comes where both limits are one
        return None, f"did not finish in {seconds / 60:g} min"
    if done.returncode < 0:
        return None, f"crashed (signal {-done.returncode})"
    if done.returncode != 0:
        return None, f"ended with status {done.returncode}: {''.join(done.stderr.strip().splitlines()[-1:])}"
    return done.stdout, "ok"


def kept(file, make):
    """What is in the file, or what `make` gives, which is kept there: a killed study goes on where it was."""
    if not file.exists():
        file.write_text(json.dumps(make()), encoding="utf-8")
    return json.loads(file.read_text(encoding="utf-8"))


def solve(bench, system, solver, options, ranks, seconds, gib):
    command = [bench, system, solver, *options]
    if ranks > 1:
        command = ["mpirun", "-n", ranks, *command]

    def make():
        out, outcome = limited(command, seconds, gib)
        return json.loads(out.splitlines()[-1]) if out else {"outcome": outcome}
    return kept(system.parent / f"{solver.replace(':', '-')}-{ranks}.json", make)


def foreseen(rows, scene, solver, ranks, unknowns):
    """Seconds by the law of nested dissection through the largest system of the scene so far; 0 where there was none."""
    power = 2 if scene.endswith("3D") else 1.5
    cost = {int(r["unknowns"]): r["factorize_s"] + r["solve_s"] for r in rows
            if (r["scene"], r["solver"], r["ranks"]) == (scene, solver, ranks) and r["outcome"] in ("ok", "not converged")
            and not r["iterations"]}
    return cost[max(cost)] * (unknowns / max(cost)) ** power if cost else 0


def solvers_there(itr):
    listing = subprocess.run([itr, "solvers"], capture_output=True, text=True, env=ENVIRONMENT, check=True).stdout
    rows = [line for line in listing.splitlines() if line and not line[0].isspace()]
    for row in rows:
        if "absent:" in row:
            print("left out:", row)
    return [row.split()[0] for row in rows if "absent:" not in row]


def table(rows, scene):
    sizes = sorted({int(row["unknowns"]) for row in rows if row["scene"] == scene and row["unknowns"]})
    lines = [f"**{scene}**: seconds of analysis + factorisation + solve (fill in 10⁶ entries or iterations; residual)", "",
             "| solver | " + " | ".join(f"{n:,} unknowns".replace(",", " ") for n in sizes) + " |", "|---|" + "---|" * len(sizes)]
    for solver in sorted({row["solver"] for row in rows}):
        cells = []
        for n in sizes:
            row = next((r for r in rows if (r["scene"], r["solver"], r["ranks"]) == (scene, solver, 1)
                        and int(r["unknowns"]) == n), None)
            if row is None:
                cells.append("")
            elif row["outcome"] not in ("ok", "not converged"):
                cells.append(row["outcome"])
            else:
                work = (f"{row['iterations']} it.; " if row["iterations"] else
                        f"{row['factor_nonzeros'] / 1e6:.2f}; " if row["factor_nonzeros"] else "")
                cells.append(f"{row['analyze_s']:.2g} + {row['factorize_s']:.2g} + {row['solve_s']:.2g} ({work}"
                             f"{math.inf if row['residual'] in (None, '') else row['residual']:.0e})" + (" *" if row["outcome"] != "ok" else ""))
        lines.append(f"| {solver} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def ratios(rows, least):
    """Seconds of factorisation and solve over CHOLMOD's on the same system, over systems of at least so many unknowns."""
    cost = {(r["scene"], r["unknowns"], r["solver"]): r["factorize_s"] + r["solve_s"] for r in rows
            if r["outcome"] == "ok" and r["ranks"] == 1 and r["unknowns"] >= least}
    lines = [f"Factorisation + solve over `cholmod:supernodal`'s, systems from {least} unknowns: median (least to most; systems)", "",
             "| solver | 2D | 3D |", "|---|---|---|"]
    for solver in sorted({key[2] for key in cost}):
        cells = []
        for dim in ("2D", "3D"):
            some = [seconds / cost[scene, n, "cholmod:supernodal"] for (scene, n, name), seconds in cost.items()
                    if name == solver and scene.endswith(dim) and (scene, n, "cholmod:supernodal") in cost]
            cells.append(f"{numpy.median(some):.2g} ({min(some):.2g} to {max(some):.2g}; {len(some)})" if some else "")
        lines.append(f"| {solver} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def read(file):
    """Rows of an earlier run, numbers as numbers."""
    with open(file, newline="", encoding="utf-8") as text:
        return [{key: value if key in ("scene", "solver", "reuse", "outcome", "commit") or not value else json.loads(value)
                 for key, value in row.items()} for row in csv.DictReader(text)]


def plot(rows, file):
    import matplotlib
    matplotlib.use("Agg")
    matplotlib.rcParams["svg.hashsalt"] = "itr"
    from matplotlib import pyplot

    scenes = sorted({row["scene"] for row in rows})
    figure, axes = pyplot.subplots(1, len(scenes), figsize=(5 * len(scenes), 4.5), sharey=True, squeeze=False)
    named = {}
    for axis, scene in zip(axes[0], scenes):
        for i, solver in enumerate(sorted({row["solver"] for row in rows})):
            points = sorted((r["unknowns"], r["factorize_s"] + r["solve_s"]) for r in rows
                            if (r["scene"], r["solver"], r["ranks"], r["outcome"]) == (scene, solver, 1, "ok"))
            if points:
                named[solver] = axis.loglog(*zip(*points), marker="osd^v<>*xp"[i % 10], color=pyplot.cm.tab20(i))[0]
        axis.set_title(scene)
        axis.set_xlabel("unknowns")
        axis.grid(alpha=0.3)
    axes[0][0].set_ylabel("factorisation + solve [s]")
    axes[0][-1].legend(named.values(), named, fontsize=7)
    figure.tight_layout()
    figure.savefig(file, metadata={"Date": None})


def run_scene(itr, scene, sets, solver, folder, seconds, gib):
    """Processor seconds of all steps of a run on one thread, and those of their linear solves by their share of the time."""
    command = [itr, "run", scene, "-o", folder, "--overwrite", "--threads", "1", "--solver", solver, "--defaults", "polyfem"]
    for value in sets:
        command += ["--set", value]
    _, outcome = limited(command, seconds, gib)
    if outcome != "ok":
        return {"outcome": outcome}
    steps = [json.loads(line) for line in (folder / "steps.jsonl").read_text(encoding="utf-8").splitlines()]
    total = lambda key: sum(step[key] for step in steps)
    share = [step["seconds"]["linear_solve"] / max(1e-9, step["seconds"]["total"] - step["seconds"]["output"]) for step in steps]
    return {"outcome": outcome, "steps": len(steps) - 1,
            **{key: total(key) for key in ("newton_iterations", "linear_solves", "factorizations", "linear_iterations")},
            "total_s": round(total("processor_seconds"), 2),
            "linear_s": round(sum(step["processor_seconds"] * part for step, part in zip(steps, share)), 2),
            "energy": steps[-1]["energy"]["total"]}


def cell_of_ends(on, off):
    """Used again / each matrix factorised; what has no factors only has the first."""
    if on["outcome"] != "ok":
        return on["outcome"]
    if off is None:
        return f"{on['total_s']:.3g}; {on['linear_s']:.3g}; {on['linear_solves']} systems"
    if off["outcome"] != "ok":
        return f"{on['total_s']:.3g} / {off['outcome']}"
    both = lambda show: f"{show(on)} / {show(off)}"
    counts = both(lambda row: f"{row['factorizations']} of {row['linear_solves']}")
    return (f"{both(lambda row: format(row['total_s'], '.3g'))}; {both(lambda row: format(row['linear_s'], '.3g'))} = "
            f"**{on['linear_s'] / max(0.01, off['linear_s']):.2f}**; {counts}, {on['linear_iterations'] / on['linear_solves']:.1f} it.")


def table_of_ends(rows):
    scenes = list(dict.fromkeys(row["scene"] for row in rows))
    of = {(row["scene"], row["solver"], row["reuse"]): row for row in rows}
    lines = ["Scenes from end to end, one thread, factors used again / each matrix factorised: processor seconds of all steps; of them "
             "linear solves = their ratio; factorisations of so many systems, iterations a system with old factors", "",
             "| solver | " + " | ".join(scenes) + " |", "|---|" + "---|" * len(scenes)]
    for solver in sorted({row["solver"] for row in rows}):
        cells = [cell_of_ends(of[scene, solver, "on"], of.get((scene, solver, "off"))) if (scene, solver, "on") in of else ""
                 for scene in scenes]
        lines.append(f"| {solver} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def table_of_overheads(rows):
    """What checks, copies, residuals and refinement add, by solver over the systems of which it was measured."""
    lines = ["Newton's calls over the bare engine's on the same matrix (checks, copies, residual, refinement): median, most", "",
             "| solver | systems | median | most |", "|---|---|---|---|"]
    for solver in sorted({row["solver"] for row in rows}):
        some = [row["overhead"] for row in rows if row["solver"] == solver and row["ranks"] == 1
                and row["unknowns"] >= 2000 and row.get("overhead") not in (None, "")]
        if some:
            lines.append(f"| {solver} | {len(some)} | {100 * numpy.median(some):.1f} % | {100 * max(some):.1f} % |")
    return "\n".join(lines)


def write_csv(file, keys, rows):
    with open(file, "w", newline="", encoding="utf-8") as text:
        writer = csv.DictWriter(text, keys, extrasaction="ignore")
        writer.writeheader()
        writer.writerows(rows)


def write(rows, ends, folder):
    folder.mkdir(parents=True, exist_ok=True)
    write_csv(folder / "results.csv", KEYS, rows)
    write_csv(folder / "end_to_end.csv", END_KEYS, ends)
    plot(rows, folder / "solvers.svg")
    parts = [ratios(rows, 8000), table_of_ends(ends), table_of_overheads(rows),
             *(table(rows, scene) for scene in dict.fromkeys(row["scene"] for row in rows))]
    (folder / "tables.md").write_text("\n\n".join(parts) + "\n", encoding="utf-8")
    return "\n\n".join(parts)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--build", type=pathlib.Path, default=ROOT / "build" / "release")
    parser.add_argument("--work", type=pathlib.Path, default=ROOT / "results" / "solvers", help="for dumped systems")
    parser.add_argument("--most", type=int, default=1_000_000, help="larger systems are left out")
    parser.add_argument("--scene", nargs="*", help="only these; rows of others stay")
    parser.add_argument("--seconds", type=float, default=1200, help="a solver has for a system")
    parser.add_argument("--end-seconds", type=float, default=600, help="a solver has for a scene from end to end")
    parser.add_argument("--dump-seconds", type=float, default=1200, help="a run has to reach its end; else its last system counts")
    parser.add_argument("--ends", action="store_true", help="only run the scenes from end to end")
    parser.add_argument("--once-from", type=int, default=30_000, help="larger systems are factorised once")
    parser.add_argument("--gib", type=float, default=16, help="a solver has for a system, of address space")
    parser.add_argument("--ranks", type=int, nargs="*", default=[1, 2], help="for mumps")
    parser.add_argument("--output", type=pathlib.Path, default=HERE)
    arguments = parser.parse_args()
    itr, bench = arguments.build / "bin" / "itr", arguments.build / "bin" / "itr_solver_bench"

    def earlier(name):
        file = arguments.output / name
        return [row for row in read(file) if row["scene"] not in arguments.scene] if arguments.scene and file.exists() else []

    rows = read(arguments.output / "results.csv") if arguments.ends else earlier("results.csv")
    ends = earlier("end_to_end.csv")
    solvers = solvers_there(itr)
    for name, scene, sets, sizes in SCENES:
        if arguments.scene and name not in arguments.scene:
            continue
        if not scene.exists():
            print("left out:", scene, "is not there")
            continue
        beaten = set()
        for number, size in enumerate(() if arguments.ends else sizes):
            folder = arguments.work / f"{name.replace(' ', '-')}-{number}"
            system = dump(itr, scene, [*sets, *size], folder, arguments.dump_seconds)
            if system is None:
                print(f"left out: {name} with {size}: no system (see {folder / 'log'})", flush=True)
                continue
            unknowns = numpy.load(system / "rhs.npy", mmap_mode="r").shape[0]
            if unknowns > arguments.most:
                print(f"left out: {name} with {unknowns} unknowns", flush=True)
                continue
            for solver in solvers:
                for ranks in arguments.ranks if solver == "mumps" else [1]:
                    if (solver, ranks) in beaten:  # larger systems only take longer
                        continue
                    flags = ["--once"] if unknowns > arguments.once_from else []
                    row = {"unknowns": unknowns}
                    seconds = foreseen(rows, name, solver, ranks, unknowns)
                    if solver == "dense" and unknowns > DENSE_MOST:
                        row["outcome"] = "left out"
                    elif seconds > arguments.seconds:
                        row["outcome"] = f"did not finish ({seconds / 60:.0f} min foreseen)"
                    else:
                        row.update(solve(bench, system, solver, flags, ranks, arguments.seconds, arguments.gib))
                    if row["outcome"] not in ("ok", "not converged"):
                        beaten.add((solver, ranks))
                    row.update(scene=name, solver=solver, ranks=ranks, commit=stored.made("verification/solvers/results.csv"))
                    rows.append(row)
                    print(json.dumps(row), flush=True)
        for solver, reuse in itertools.product(solvers, (True, False)):
            if solver in ITERATIVE and not reuse:
                continue
            folder = arguments.work / f"{name.replace(' ', '-')}-{solver.replace(':', '-')}{'' if reuse else '-anew'}"
            sets = [*ENDS[name], f"/solver/linear/reuse_factors={json.dumps(reuse)}"]
            end = {"outcome": "left out"} if solver == "dense" and name.endswith("3D") else kept(
                folder.with_suffix(".json"),
                lambda: run_scene(itr, scene, sets, solver, folder, arguments.end_seconds, arguments.gib))
            ends.append({"scene": name, "solver": solver, "reuse": "on" if reuse else "off",
                         "commit": stored.made("verification/solvers/end_to_end.csv"), **end})
            print(json.dumps(ends[-1]), flush=True)
        write(rows, ends, arguments.output)
    print(write(rows, ends, arguments.output))
    return 0


sys.exit(main())
