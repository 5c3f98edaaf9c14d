#!/usr/bin/python3
# SPDX-License-Identifier: MIT
"""Runs ITR, CalculiX and GetFEM on the same meshes one after another, on one thread each, and writes results.csv, references.csv,
error.svg and the tables of README.md.

usage: run.py [--case NAME]... [--levels N] [--itr PATH] [--work DIR] [--again] [--page] [--references]

A row that results.csv has already is not measured again without --again. --references computes what errors are measured against.
"""
import argparse
import csv
import fcntl
import importlib.util
import math
import os
import pathlib
import re
import shutil
import statistics
import subprocess
import sys

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parent.parent
sys.path[:0] = [str(HERE), str(HERE.parent)]
import problems  # noqa: E402
import snap_hook  # noqa: E402
import with_calculix  # noqa: E402
import with_getfem  # noqa: E402
import with_itr  # noqa: E402
from harness import stored  # noqa: E402
from methods import CASES, ELEMENTS, FINER_PROBLEM, KNOWN, REFERENCES, SAME_REFERENCE  # noqa: E402

CODES = {"ITR": with_itr, "CalculiX": with_calculix, "GetFEM": with_getfem}
FIELDS = ["case", "code", "elements", "level", "unknowns", "value", "reference", "error", "bar", "processor_seconds", "runs",
          "iterations", "increments", "settings", "version", "commit"]
ONE_THREAD = {name: "1" for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "CCX_NPROC_RESULTS")}
SHORT = 1.0  # processor seconds below which the median of three runs counts
RESULTS, STORED = HERE / "results.csv", "verification/peers/results.csv"


def missing():
    """Words about what is not installed; empty if nothing is missing."""
    found = [] if shutil.which("ccx") else ["CalculiX (apt-get install calculix-ccx)"]
    if importlib.util.find_spec("getfem") is None:
        found.append("GetFEM (apt-get install python3-getfem)")
    return ", ".join(found)


def versions(itr):
    def first(command, pattern):
        try:
            done = subprocess.run(command, capture_output=True, text=True)
        except FileNotFoundError:
            return ""
        hit = re.search(pattern, done.stdout + done.stderr)
        return hit[1] if hit else ""

    return {"ITR": first([str(itr), "--version"], r"(\d[\w.\-]*)"), "CalculiX": first(["ccx", "-v"], r"Version ([\d.]+)"),
            "GetFEM": first(["dpkg-query", "-W", "-f", "${Version}", "python3-getfem"], r"([\d.]+)")}


def timed(command, folder, limit):
    """Processor seconds of a child, or None if it failed or took longer than the limit."""
    with open(folder / "log.txt", "w") as log:
        child = subprocess.Popen(command, cwd=folder, stdout=log, stderr=log, env={**os.environ, **ONE_THREAD},
                                 preexec_fn=lambda: limit_processor(limit))
        _, status, used = os.wait4(child.pid, 0)
        child.returncode = status
    return used.ru_utime + used.ru_stime if status == 0 else None


def limit_processor(seconds):
    import resource
    resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))


def once(method, problem, folder, options):
    """(processor seconds, value, iterations, increments), or None."""
    code = CODES[method.code]
    seconds = timed(code.command(options.itr, folder), folder, options.limit)
    if seconds is None:
        return None
    try:
        curves, iterations, increments = code.read(problem, folder)
    except (OSError, KeyError, ValueError):
        return None
    if curves["t"][-1] < problem.tend * (1 - 1e-6) or method.code == "ITR" and not certified(folder, options):
        return None
    return seconds, problem.measure(curves), iterations, increments


def certified(folder, options):
    return subprocess.run([str(options.itr), "certify", str(folder / "run")], capture_output=True).returncode == 0


def write(method, case, level, folder):
    folder.mkdir(parents=True, exist_ok=True)
    problem = getattr(problems, case)(level, folder)
    CODES[method.code].write(problem, folder, method.order, method.at(level))
    return problem


def bar_of(method, problem, folder, options):
    """Of another run of ITR, which estimates its errors and is not timed."""
    if method.code != "ITR":
        return None
    settings = method.at(0)
    keys = {**settings.get("keys", {}), "/output/error_bars": True}
    with_itr.write(problem, folder, method.order, {**settings, "keys": keys})
    return with_itr.bar(problem, folder) if timed(with_itr.command(options.itr, folder), folder, options.limit) else None


def measure(method, case, level, options):
    """A row: the median of three runs where they are short."""
    folder = options.work / case / f"{method.code}-{method.order}-{level}".lower()
    if case == "snap_hook":
        problem, runs = None, snap_hook.measure(method, level, folder, options, timed)
    else:
        problem, runs = write(method, case, level, folder), []
        while not runs or (runs[0] and runs[0][0] < SHORT and len(runs) < 3):
            runs.append(once(method, problem, folder, options))
    row = {"case": case, "code": method.code, "elements": ELEMENTS[method.order], "level": level,
           "unknowns": problem.unknowns(method.order) if problem else snap_hook.unknowns(method, level),
           "settings": method.words(), "version": options.versions[method.code], "commit": stored.made(STORED)}
    if all(runs):
        _, value, iterations, increments = runs[0]
        bar = bar_of(method, problem, folder, options) if problem and runs[0][0] < 10 else None
        row |= {"value": f"{value:.7g}", "bar": "" if bar is None else f"{bar:.3g}", "runs": len(runs),
                "processor_seconds": f"{statistics.median(r[0] for r in runs):.3g}", "iterations": iterations, "increments": increments}
    return row


def read_rows(path):
    if not path.exists():
        return []
    with open(path, newline="") as file:
        return list(csv.DictReader(file))


def key_of(row):
    return row["case"], row["code"], row["elements"], int(row["level"])


def store(path, rows, fields):
    with open(path, "w", newline="") as file:
        writer = csv.DictWriter(file, fields, lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


def limit_of(values):
    """Of three values the limit of a geometric series, else the last."""
    if len(values) < 3:
        return values[-1]
    first, second = values[1] - values[0], values[2] - values[1]
    return values[2] + second**2 / (first - second)


def run_references(options):
    """The finest runs or, of three levels, their limit; and what these are worth, the difference to the next coarser one."""
    rows = {(r["case"]): r for r in read_rows(HERE / "references.csv")}
    for case, (source, method, levels) in REFERENCES.items():
        if case in rows and not options.again or options.case and case not in options.case:
            continue
        if method is None:
            value, (worth, words) = source, KNOWN[case]
        else:
            values = []
            for level in levels:
                folder, problem = options.work / "references" / f"{case}-{level}", FINER_PROBLEM.get(case, case)
                patient = argparse.Namespace(itr=options.itr, limit=1000)
                done = once(method, write(method, problem, level, folder), folder, patient)
                values.append(done[1] if done else math.nan)
            value, worth, words = limit_of(values), abs(values[-1] - values[-2]), source
            worth = abs(value - values[-1]) if len(values) == 3 else worth
        rows = {r["case"]: r for r in read_rows(HERE / "references.csv")}
        rows[case] = {"case": case, "reference": f"{value:.7g}", "worth": f"{worth:.2g}", "source": words, "commit": stored.made(STORED)}
        print(rows[case], flush=True)
        store(HERE / "references.csv", list(rows.values()), ["case", "reference", "worth", "source", "commit"])


def with_errors(rows):
    """The rows with errors against references.csv."""
    references = {r["case"]: float(r["reference"]) for r in read_rows(HERE / "references.csv")}
    for row in rows:
        reference = references.get(SAME_REFERENCE.get(row["case"], row["case"]))
        row["reference"] = "" if reference is None else f"{reference:.7g}"
        row["error"] = f"{float(row['value']) / reference - 1:.3g}" if reference and row.get("value") else ""
    return rows


def add(row):
    """Adds a row to results.csv, in the order of the page; several cases may be measured at once."""
    with open(HERE / "README.md") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        rows = {key_of(r): r for r in read_rows(RESULTS)} | {key_of(row): row}
        order = {case: k for k, case in enumerate(CASES)}
        place = lambda r: (order[r["case"]], list(CODES).index(r["code"]), r["elements"], int(r["level"]))
        store(RESULTS, with_errors(sorted(rows.values(), key=place)), FIELDS)


def run_all(options):
    for case, methods in CASES.items():
        if options.case and case not in options.case:
            continue
        for level in range(options.levels):
            for method in methods:
                done = {key_of(row) for row in read_rows(RESULTS)}
                if level >= method.levels or (case, method.code, ELEMENTS[method.order], level) in done and not options.again:
                    continue
                row = measure(method, case, level, options)
                print({k: v for k, v in row.items() if k not in ("commit", "settings", "version")}, flush=True)
                add(row)


def page():
    import page as pages
    rows = with_errors(read_rows(RESULTS))
    store(RESULTS, rows, FIELDS)
    pages.write(rows, read_rows(HERE / "references.csv"), HERE)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--case", action="append", choices=list(CASES))
    parser.add_argument("--levels", type=int, default=3)
    parser.add_argument("--itr", type=pathlib.Path, default=ROOT / "build/release/bin/itr")
    parser.add_argument("--work", type=pathlib.Path, default=ROOT / "results/peers")
    parser.add_argument("--limit", type=int, default=200, help="processor seconds of a run, by default 200")
    parser.add_argument("--again", action="store_true", help="measure rows again that are there")
    parser.add_argument("--page", action="store_true", help="only write tables and plot from results.csv")
    parser.add_argument("--references", action="store_true", help="only compute references.csv (minutes)")
    options = parser.parse_args()
    options.work = options.work.resolve()
    if not options.page:
        if words := missing():
            parser.exit(2, f"run.py: not installed: {words}\n")
        options.versions = versions(options.itr)
        run_references(options) if options.references else run_all(options)
    page()


if __name__ == "__main__":
    main()
