#!/usr/bin/python3
# SPDX-License-Identifier: MIT
"""Runs the verification suite: every file of verification/cases is a case with a quantity, a reference and a tolerance.

python3 verification/run.py [--quick] [--page] [--case NAME]... [--jobs N] [--build build/release] [--report DIR]

A full run, or one of some cases, brings verification/report up to date; --quick writes into BUILD/verification, so that it
never replaces figures of a full run. --page runs nothing and writes the pages anew: how old results are. Exit status: 0 passed, 1 a case failed.
"""
import argparse
import concurrent.futures
import contextlib
import importlib
import importlib.util
import io
import json
import multiprocessing
import os
import pathlib
import shutil
import sys
import time

SYSTEM_PYTHON = "/usr/bin/python3"  # Debian's, which python3-dolfinx and its like are for
if importlib.util.find_spec("dolfinx") is None and os.path.exists(SYSTEM_PYTHON) and "ITR_REEXECUTED" not in os.environ:
    os.execve(SYSTEM_PYTHON, [SYSTEM_PYTHON, *sys.argv], {**os.environ, "ITR_REEXECUTED": "1"})

HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))
from harness import stored as provenance  # noqa: E402
from harness.overview import overview  # noqa: E402
from harness.report import write_report  # noqa: E402
from harness.suite import Context, load_cases, run_case, save_json  # noqa: E402

ROOT = HERE.parent
LONG = {"matrices", "orders", "simple", "squeeze", "stability", "statics"}  # begun first, so that none is left alone at the end


def versions(build):
    """Of the programs and packages that the figures come from."""
    found = {"python": sys.version.split()[0]}
    for name in ("dolfinx", "numpy", "scipy", "h5py", "meshio", "matplotlib"):
        if importlib.util.find_spec(name):
            found[name] = importlib.import_module(name).__version__
    return found


def parse():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="smaller and fewer cases: minutes instead of hours")
    parser.add_argument("--page", action="store_true", help="run nothing")
    parser.add_argument("--case", action="append", metavar="NAME", help="only this one; may be given again")
    parser.add_argument("--jobs", type=int, default=1, help="cases at a time; their seconds are then those of a busy machine")
    parser.add_argument("--build", type=pathlib.Path, default=ROOT / "build/release")
    parser.add_argument("--shared", type=pathlib.Path, default=ROOT.parent / "shared", help="folder of the paper's scenes")
    parser.add_argument("--report", type=pathlib.Path, help="folder of the report")
    return parser.parse_args()


def compile_plainly():
    """Lets DOLFINx compile its forms without optimisation, which takes longer than what quick cases do with them."""
    if importlib.util.find_spec("dolfinx"):
        jit = importlib.import_module("dolfinx.jit")
        for name in {"DOLFINX_DEFAULT_JIT_PARAMETERS", "DOLFINX_DEFAULT_JIT_OPTIONS"} & set(vars(jit)):  # by version
            vars(jit)[name]["cffi_extra_compile_args"] = (["-O0", "-g0"], "")


def perform(name, options, build, report):
    """The entry of a case, which prints its results as they come."""
    if options.quick:
        compile_plainly()
    folder = build / ("verification-quick-runs" if options.quick else "verification-runs") / name
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    print(f"{name}", flush=True)
    start = time.perf_counter()
    entry = run_case(load_cases()[name], Context(folder, report, build, options.shared, options.quick, name))
    print(f"  {entry['status']} in {time.perf_counter() - start:.1f} s" + (f": {entry['message']}" if entry["message"] else ""),
          flush=True)
    return entry


def perform_quietly(name, options, build, report):
    """The entry of a case, and what it printed: for cases that run beside others. DOLFINx's compiled forms have a folder for each
    case, since a case that waits for another's compiler gives up after ten seconds."""
    os.environ["XDG_CACHE_HOME"] = str(build / "verification-cache" / name)
    with contextlib.redirect_stdout(io.StringIO()) as text:
        entry = perform(name, options, build, report)
    return entry, text.getvalue()


def perform_all(chosen, options, build, report):
    """(name, entry) of each case as it ends."""
    if options.jobs == 1:
        yield from ((name, perform(name, options, build, report)) for name in chosen)
        return
    with concurrent.futures.ProcessPoolExecutor(options.jobs, multiprocessing.get_context("spawn")) as pool:
        longest_first = sorted(chosen, key=lambda name: name not in LONG)
        pending = {pool.submit(perform_quietly, name, options, build, report): name for name in longest_first}
        for done in concurrent.futures.as_completed(pending):
            entry, text = done.result()
            print(text, end="", flush=True)
            yield pending[done], entry


def main():
    options = parse()
    build = options.build.resolve()
    report = (options.report or (build / "verification" if options.quick else HERE / "report")).resolve()
    report.mkdir(parents=True, exist_ok=True)
    cases = load_cases()
    chosen = [] if options.page else options.case or list(cases)
    if unknown := [name for name in chosen if name not in cases]:
        sys.exit(f"no such case: {', '.join(unknown)}; there are: {', '.join(cases)}")

    stored = report / "results.json"
    entries = json.loads(stored.read_text())["cases"] if stored.exists() else {}
    found = versions(build)
    ran = {}
    for name, entry in perform_all(chosen, options, build, report):
        ran[name] = entry
        ran[name]["versions"] = {**found, "itr": provenance.made("verification/report/results.json", name)}
    # A case that could not run keeps the figures of when it could.
    entries.update({name: entry for name, entry in ran.items() if entry["status"] != "skipped" or name not in entries})
    entries = {name: entries[name] for name in cases if name in entries}
    save_json(stored, {"cases": entries})  # ages are of what is stored
    save_json(stored, {"cases": entries, "overview": overview([name for name in cases if name not in entries])})
    content = json.loads(stored.read_text())
    write_report(report, content["cases"], content["overview"])

    by_status = {status: [n for n, e in ran.items() if e["status"] == status] for status in ("passed", "failed", "skipped")}
    print("; ".join(f"{len(names)} {status}" + (f" ({', '.join(names)})" if names and status != "passed" else "")
                    for status, names in by_status.items()) + f"; report in {report}")
    return 1 if by_status["failed"] else 0


if __name__ == "__main__":
    sys.exit(main())
