#!/usr/bin/python3
# SPDX-License-Identifier: MIT
"""Conjugate gradients and multigrid (belos:muelu) over MPI ranks: iterations, residual, and the memory of each rank, on the cubes of
run.py. Writes ranks.csv and prints the table of README.md. Nothing here is a time: the ranks share a machine.

/usr/bin/python3 verification/scaling/ranks.py [--build build/release] [--work DIR] [--cells N...] [--ranks N...]
"""
import argparse
import csv
import json
import pathlib
import resource
import subprocess
import sys

HERE = pathlib.Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent)]
from harness import stored  # noqa: E402
import run as cubes  # noqa: E402

KEYS = ["unknowns", "nonzeros", "ranks", "iterations", "residual", "outcome", "rank_0_mb", "largest_other_mb", "all_mb", "commit"]


def as_rank(folder, command):
    """One rank's process: runs the command, and leaves what memory it took at most [MB]."""
    status = subprocess.run(command, check=False).returncode
    peak = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024
    (folder / cubes.os.environ["OMPI_COMM_WORLD_RANK"]).write_text(f"{peak:.0f}", encoding="utf-8")
    return status


def measure(bench, system, ranks, work):
    peaks = work / f"{system.name}-{ranks}"
    peaks.mkdir(parents=True, exist_ok=True)
    command = ["mpirun", "-n", ranks, sys.executable, __file__, "--as-rank", peaks, bench, system, "belos:muelu", "--once"]
    done = subprocess.run(list(map(str, command)), capture_output=True, text=True, env=cubes.ENVIRONMENT, check=False)
    if done.returncode != 0:
        return {"outcome": (done.stderr.strip().splitlines() or ["?"])[-1]}
    row = json.loads(done.stdout.splitlines()[-1])
    mb = [int((peaks / str(rank)).read_text(encoding="utf-8")) for rank in range(ranks)]
    return {**row, "rank_0_mb": mb[0], "largest_other_mb": max(mb[1:], default=""), "all_mb": sum(mb)}


def main():
    if sys.argv[1:2] == ["--as-rank"]:
        return as_rank(pathlib.Path(sys.argv[2]), sys.argv[3:])
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--build", type=pathlib.Path, default=cubes.ROOT / "build" / "release")
    parser.add_argument("--work", type=pathlib.Path, default=cubes.ROOT / "results" / "ranks")
    parser.add_argument("--cells", type=int, nargs="*", default=[19, 31, 43])
    parser.add_argument("--ranks", type=int, nargs="*", default=[1, 2, 4])
    parser.add_argument("--output", type=pathlib.Path, default=HERE)
    arguments = parser.parse_args()
    rows = []
    for cells in arguments.cells:
        system = arguments.work / f"cube-{cells}"
        cubes.write_system(system, 3, cells)
        for ranks in arguments.ranks:
            row = measure(arguments.build / "bin" / "itr_solver_bench", system, ranks, arguments.work)
            rows.append({key: row.get(key, "") for key in KEYS} | {"ranks": ranks, "commit": stored.made("verification/scaling/ranks.csv")})
            print(rows[-1], flush=True)
    with open(arguments.output / "ranks.csv", "w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, KEYS)
        writer.writeheader()
        writer.writerows(rows)
    print("| unknowns | ranks | iterations | residual | MB of rank 0 | of the largest other | of all |\n|" + "---|" * 7)
    for row in rows:
        print("| " + " | ".join(str(row[key]) for key in KEYS[:1] + KEYS[2:5] + KEYS[6:9]) + " |")
    return 0


if __name__ == "__main__":
    sys.exit(main())
