#!/usr/bin/python3
# SPDX-License-Identifier: MIT
"""What one machine holds: the plate of million.py at 1e4, 1e5 and 1e6 unknowns by a direct engine and by multigrid, on one core and
on two. Adds rows to machine.csv, and prints them as a table. On idle cores: a quarter of an hour.

/usr/bin/python3 verification/scaling/machine.py [--build build/release] [--work DIR] [--sizes 40 128 410] [--solvers auto belos:muelu] [--steps 4]
"""
import argparse
import csv
import pathlib
import sys

import million

HERE = pathlib.Path(__file__).resolve().parent
FILE = HERE / "machine.csv"
THREADS = (1, 2)


def table():
    """The rows of machine.csv, those of one size and engine side by side."""
    rows = list(csv.DictReader(open(FILE, encoding="utf-8")))
    found = {(row["unknowns"], row["taken"], int(row["threads"])): row for row in rows}
    lines = ["| unknowns | engine | seconds a step, 1 core | 2 cores | iterations of Newton a step | memory |", "|---|---|---|---|---|---|"]
    for unknowns, taken in dict.fromkeys((row["unknowns"], row["taken"]) for row in rows):
        one, two = (found.get((unknowns, taken, n)) for n in THREADS)
        a_step = lambda row, key: float(row[key]) / int(row["steps"]) if row else float("nan")
        lines.append(f"| {int(unknowns):,} | `{taken}` | {a_step(one, 'seconds'):.3g} | {a_step(two, 'seconds'):.3g} "
                     f"| {a_step(one or two, 'newton_iterations'):.2g} | {int((one or two)['peak_mb']) / 1000:.2g} GB |".replace(",", " "))
    return "\n".join(lines)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    million.add_arguments(parser)
    parser.set_defaults(steps=4)
    parser.add_argument("--sizes", type=int, nargs="*", default=[40, 128, 410], help="cells along an edge of the plate")
    parser.add_argument("--solvers", nargs="*", default=["auto", "belos:muelu"])
    parser.add_argument("--table", action="store_true", help="only print what is stored")
    options = parser.parse_args()
    if options.table:
        print(table())
        return 0
    for cells in options.sizes:
        for solver in options.solvers:
            for threads in THREADS:
                options.cells, options.solver, options.threads = cells, solver, threads
                row = million.run(options)
                if row is None:
                    return 1
                million.store(FILE, row)
                print(f"{cells} {solver} {threads}: {row['seconds']} s, {row['peak_mb']} MB", flush=True)
    print(table())
    return 0


if __name__ == "__main__":
    sys.exit(main())
