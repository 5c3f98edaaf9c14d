#!/usr/bin/python3
# SPDX-License-Identifier: MIT
"""Runs problems of contact with published values by ITR on three meshes each, with error bars, and writes referee.csv and the table
of README.md.

usage: referee.py [--problem NAME]... [--levels N] [--itr PATH] [--work DIR] [--again] [--page]
"""
import argparse
import csv
import json
import pathlib
import subprocess
import sys

import numpy as np

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parent.parent
sys.path[:0] = [str(HERE), str(HERE.parent)]
import page  # noqa: E402
import problems  # noqa: E402
import with_itr  # noqa: E402
from cases import ironing  # noqa: E402
from harness import stored  # noqa: E402
from methods import TOUCHING  # noqa: E402

STORED = "verification/peers/referee.csv"
FIELDS = ["problem", "level", "quantity", "published", "value", "bar", "sources", "without_bar", "iterations", "commit"]
SOURCES = ("mesh", "dhat", "friction", "lag", "solver")
IRONING = "1.02 to 1.89", "3.37 to 4.21", "2.47 to 3.04", "0.30 to 0.53"  # five codes: H and V at 1.5, V at 0.95, H over V


class Curve:
    """A column of a file of results, by time, and its estimated errors by source; nan where a step has no bar."""

    def __init__(self, path, name, column, scale):
        rows = [row for row in csv.DictReader(path.read_text().splitlines()) if row["name"] == name]
        numbers = lambda key: np.array([float(row[key] or "nan") for row in rows])
        self.t, self.values = numbers("t"), scale * numbers(column)
        self.errors = {source: scale * numbers(f"{column}_error_{source}") for source in SOURCES}

    def at(self, t):
        step = np.argmin(abs(self.t - t))
        return Estimate(self.values[step], {source: errors[step] for source, errors in self.errors.items()})

    def mean(self, t0):
        late = self.t >= t0 - 1e-9
        known = late & np.isfinite(self.errors["mesh"])
        return Estimate(self.values[late].mean(), {source: errors[known].mean() for source, errors in self.errors.items()},
                        1 - known.sum() / late.sum())


class Estimate:
    """A value, what it is estimated to be wrong by, by source, and the share of the steps that have no bar."""

    def __init__(self, value, errors, unknown=0.0):
        self.value, self.errors, self.unknown = value, errors, unknown
        self.bar = sum(abs(error) for error in errors.values())

    def over(self, other):
        errors = {s: self.errors[s] / other.value - self.value * other.errors[s] / other.value**2 for s in SOURCES}
        return Estimate(self.value / other.value, errors, max(self.unknown, other.unknown))


def measure_ironing(level, folder, itr, **shape):
    h = 0.2 / 2**level
    content = ironing.ironing_scene(folder, "ironing", h, h, **shape)
    content["output"]["error_bars"] = True
    iterations = run(content, folder, itr)
    along, down = (Curve(folder / "run/forces.csv", "die", f"reaction_{axis}", scale / 1e8) for axis, scale in (("x", 1), ("y", -1)))
    values = along.at(1.5), down.at(1.5), down.at(0.95)
    friction = along.mean(2).over(down.mean(2))
    names = "H at t 1.5", "V at t 1.5", "V at t 0.95", "H over V, mean from t 2 on"
    return [*zip(names, IRONING, (*values, friction)), ("H, mean from t 2 on", "", along.mean(2)),
            ("V, mean from t 2 on", "", down.mean(2))], iterations


def measure_last(case, name, quantity, published):
    def measured(level, folder, itr):
        problem = getattr(problems, case)(level, folder)
        content = with_itr.scene(problem, folder, 1, 1.0)
        with_itr.set_keys(content, {**TOUCHING, "/output/error_bars": True})
        iterations = run(content, folder, itr)
        return [(quantity, published, Curve(folder / "run/points.csv", name, "u_y", -1).at(1.0))], iterations

    return measured


PROBLEMS = {
    "ironing": measure_ironing,
    "ironing, gap 0.25": lambda *place: measure_ironing(*place, gap=0.25),
    "ironing, die 3 high": lambda *place: measure_ironing(*place, height=3.0),
    "ironing, plain contact": lambda *place: measure_ironing(*place, averages=False),
    "cylinder on block": measure_last("hertz", "top", "sinking [mm]", "1.30264"),
    "punch": measure_last("punch", "middle", "sinking [mm]", "0.132897"),
}
LEVELS = {"ironing": 3, "cylinder on block": 3, "punch": 3}  # others: 1, to tell what a shape changes


def run(content, folder, itr):
    (folder / "scene.json").write_text(json.dumps(content, indent=1) + "\n")
    with open(folder / "log.txt", "w") as log:
        subprocess.run(with_itr.command(itr, folder), stdout=log, stderr=log, cwd=folder, check=True)
        subprocess.run([str(itr), "certify", str(folder / "run")], stdout=log, stderr=log, check=True)
    return sum(json.loads(line).get("newton_iterations", 0) for line in open(folder / "run/steps.jsonl"))


def rows_of(problem, level, options):
    folder = (options.work / problem.replace(", ", "-").replace(" ", "-") / str(level)).resolve()
    folder.mkdir(parents=True, exist_ok=True)
    estimates, iterations = PROBLEMS[problem](level, folder, options.itr)
    made = stored.made(STORED)
    for quantity, published, estimate in estimates:
        largest = sorted(SOURCES, key=lambda source: -abs(estimate.errors[source]))[:2]
        sources = ", ".join(f"{source} {estimate.errors[source]:+.2g}" for source in largest)
        is_known = np.isfinite(estimate.bar)
        yield {"problem": problem, "level": level, "quantity": quantity, "published": published, "value": f"{estimate.value:.5g}",
               "bar": f"{estimate.bar:.2g}" if is_known else "", "sources": sources if is_known else "",
               "without_bar": f"{estimate.unknown:.2f}", "iterations": iterations, "commit": made}


def read():
    path = HERE / "referee.csv"
    return list(csv.DictReader(path.read_text().splitlines())) if path.exists() else []


def store(rows):
    order = list(PROBLEMS)
    with open(HERE / "referee.csv", "w", newline="") as file:
        writer = csv.DictWriter(file, FIELDS, lineterminator="\n")
        writer.writeheader()
        writer.writerows(sorted(rows, key=lambda row: (order.index(row["problem"]), int(row["level"]))))


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--problem", action="append", choices=list(PROBLEMS))
    parser.add_argument("--levels", type=int, default=3)
    parser.add_argument("--itr", type=pathlib.Path, default=ROOT / "build/release/bin/itr")
    parser.add_argument("--work", type=pathlib.Path, default=ROOT / "results/referee")
    parser.add_argument("--again", action="store_true", help="run again what referee.csv has")
    parser.add_argument("--page", action="store_true", help="only write the table from referee.csv")
    options = parser.parse_args()
    for problem in () if options.page else options.problem or PROBLEMS:
        for level in range(min(options.levels, LEVELS.get(problem, 1))):
            done = {(row["problem"], int(row["level"])) for row in read()}
            if (problem, level) in done and not options.again:
                continue
            new = list(rows_of(problem, level, options))
            store([row for row in read() if (row["problem"], int(row["level"])) != (problem, level)] + new)
            for row in new:
                print(*(row[key] for key in ("problem", "level", "quantity", "published", "value", "bar", "sources")), sep="; ", flush=True)
    readme = HERE / "README.md"
    readme.write_text(page.put(readme.read_text(), "referee", page.referee_table(read())))


if __name__ == "__main__":
    main()
