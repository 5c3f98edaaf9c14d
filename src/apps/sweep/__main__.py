# SPDX-License-Identifier: MIT
"""`itr sweep`: runs of one scene with other values, for GNU parallel or a job array. Writes a line of shell for each run into
commands.txt, and collects what is there into sweep.csv. The first argument is the command `itr`, the others are the sweep's."""

import argparse
import csv
import io
import itertools
import json
import os
import pathlib
import shlex
import subprocess
import sys

BAD_INPUT = 2  # exit status
MOST_RUNS = 100_000


def fail(text):
    sys.stderr.write(f"itr: {text}\n")
    sys.exit(BAD_INPUT)


def read_options(words):
    parser = argparse.ArgumentParser("itr sweep", allow_abbrev=False)
    parser.description = "runs of a scene with other values: their commands for GNU parallel or a job array, and their results in one table"
    add = parser.add_argument
    add("scene", nargs="?", help="scene file (JSON); none with --collect")
    add("-o", "--output", help="folder (default: sweep/<scene>)")
    add("--vary", action="append", default=[], metavar="POINTER=V1,V2,...",
        help="values of a key, or a JSON array of them; several: all combinations")
    add("--set", action="append", default=[], metavar="POINTER=VALUE", help="for all runs")
    add("--threads", type=int, default=1, help="of each run (default: 1)")
    add("--solver", default="", help="linear solver, see `itr solvers`")
    add("--defaults", choices=("itr", "polyfem"), help="what keys that the scene leaves out stand for, see docs/scenes.md")
    add("--collect", metavar="DIR", help="writes sweep.csv of the runs that are in the folder")
    options = parser.parse_args(words)
    if options.collect and (options.scene or options.vary or options.set):
        parser.error("--collect: takes a folder alone")
    if not options.collect and not options.scene:
        parser.error("a scene, or --collect DIR")
    if not options.collect and not options.vary:
        parser.error("--vary: nothing to vary")
    if options.threads < 1:
        parser.error(f"--threads: found {options.threads}; expected 1 or more")
    return options


def value_of(text):
    """The JSON that a word stands for; a word that is none is a string."""
    try:
        return json.loads(text)
    except ValueError:
        return text


def read_variation(text):
    """The key and its values."""
    pointer, sign, values = text.partition("=")
    if not sign or not pointer.startswith("/"):
        fail(f'--vary: found "{text}"; expected /json/pointer=VALUE,VALUE,...')
    whole = value_of(values)
    listed = whole if isinstance(whole, list) else [value_of(word) for word in values.split(",")]
    if not listed or "" in listed:
        fail(f'--vary: found "{text}"; expected values between the commas')
    return pointer, listed


def combinations_of(variations):
    """A dictionary of values by key for each run."""
    pointers = [pointer for pointer, _ in variations]
    if len(set(pointers)) < len(pointers):
        fail(f"--vary: found a key twice; expected each once: {', '.join(pointers)}")
    count = 1
    for _, values in variations:
        count *= len(values)
    if count > MOST_RUNS:
        fail(f"--vary: found {count} combinations; expected at most {MOST_RUNS}")
    return [dict(zip(pointers, values)) for values in itertools.product(*(values for _, values in variations))]


def command_of(itr, options, folder, values):
    words = [itr, "run", os.path.abspath(options.scene), "-o", str(folder), "--resume", "--threads", str(options.threads)]
    for pointer, value in values.items():
        words += ["--set", f"{pointer}={json.dumps(value)}"]
    for text in options.set:
        words += ["--set", text]
    if options.solver:
        words += ["--solver", options.solver]
    if options.defaults:
        words += ["--defaults", options.defaults]
    return shlex.join(words)


def check(itr, options, runs):
    """Refuses what the command refuses of these runs: a key that is none would else show after the sweep."""
    for values in runs:
        settings = [*(f"{pointer}={json.dumps(value)}" for pointer, value in values.items()), *options.set]
        words = [word for text in settings for word in ("--set", text)]
        if options.defaults:
            words += ["--defaults", options.defaults]
        done = subprocess.run([itr, "explain", options.scene, *words], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        if done.returncode == BAD_INPUT:
            sys.stderr.write(done.stderr)
            sys.exit(BAD_INPUT)


def names_of(runs):
    width = len(str(len(runs) - 1))
    return [f"{number:0{width}}" for number in range(len(runs))]


def write_whole(path, text):
    """A file that is there whole or as it was."""
    other = path.with_name(path.name + ".tmp")
    other.write_text(text)
    other.replace(path)


def plan(itr, options):
    folder = pathlib.Path(options.output or pathlib.Path("sweep", pathlib.Path(options.scene).stem)).absolute()
    if not os.path.exists(options.scene):
        fail(f"{options.scene}: no such file; expected a scene")
    runs = combinations_of([read_variation(text) for text in options.vary])
    described = {"scene": os.path.abspath(options.scene), "set": options.set, "solver": options.solver, "defaults": options.defaults,
                 "runs": runs}
    known = folder / "sweep.json"
    if known.exists() and json.loads(known.read_text()) != described:
        fail(f"{known}: another sweep; expected another folder (-o), or the same scene and values to go on")
    check(itr, options, runs[:1] + runs[1:][-1:])
    folder.mkdir(parents=True, exist_ok=True)
    lines = [command_of(itr, options, folder / "runs" / name, values) for name, values in zip(names_of(runs), runs)]
    write_whole(known, json.dumps(described, indent=1) + "\n")
    write_whole(folder / "commands.txt", "\n".join(lines) + "\n")
    array = ["#!/bin/sh", f"#SBATCH --array=1-{len(lines)}", f"#SBATCH --cpus-per-task={options.threads}",
             f'sed -n "${{SLURM_ARRAY_TASK_ID}}p" {shlex.quote(str(folder / "commands.txt"))} | sh']
    write_whole(folder / "array.slurm", "\n".join(array) + "\n")
    there = shlex.quote(str(folder))
    print(f"{len(lines)} runs in {folder}; each goes on where it was stopped. To run them:\n"
          f"  parallel -j {max(1, (os.cpu_count() or 1) // options.threads)} < {there}/commands.txt\n"
          f"  sbatch {there}/array.slurm\n"
          f"and at any time: itr sweep --collect {there}")


def peaks_of(path):
    """The largest force on each name of forces.csv, over all steps."""
    peaks = {}
    if not path.exists():
        return peaks
    with open(path, newline="") as file:
        for row in csv.DictReader(file):
            parts = [float(row[key]) for key in ("all_x", "all_y", "all_z") if row.get(key)]
            size = sum(part * part for part in parts) ** 0.5
            peaks[row["name"]] = max(peaks.get(row["name"], 0.0), size)
    return peaks


def result_of(folder):
    """What a run has left; its outcome is `none` before it begins."""
    result = {"outcome": "none"}
    if (folder / "steps.jsonl").exists():
        result["outcome"] = "unfinished"
    try:
        summary = json.loads((folder / "summary.json").read_text())
    except (OSError, ValueError):
        return result
    result.update({key: summary[key] for key in ("outcome", "steps", "warning_count", "processor_seconds", "vertices",
                                                 "newton_iterations")})
    result.update(seconds=summary["seconds"]["total"], energy=summary["energy"]["total"])
    result.update({f"peak force {name}": peak for name, peak in peaks_of(folder / "forces.csv").items()})
    return result


def collect(folder):
    folder = pathlib.Path(folder)
    known = folder / "sweep.json"
    if not known.exists():
        fail(f"{folder}: no sweep.json; expected the folder of `itr sweep`")
    runs = json.loads(known.read_text())["runs"]
    rows = []
    for name, values in zip(names_of(runs), runs):
        values = {pointer: value if isinstance(value, str) else json.dumps(value) for pointer, value in values.items()}
        rows.append({"run": name, **values, **result_of(folder / "runs" / name)})
    columns = list(dict.fromkeys(key for row in rows for key in row))
    table = io.StringIO()
    writer = csv.DictWriter(table, columns, restval="")
    writer.writeheader()
    writer.writerows(rows)
    write_whole(folder / "sweep.csv", table.getvalue())
    outcomes = [row["outcome"] for row in rows]
    finished, none, unfinished = (outcomes.count(word) for word in ("finished", "none", "unfinished"))
    print(f"{folder / 'sweep.csv'}: {finished} of {len(rows)} runs are finished, {none} have not begun, {unfinished} have not ended, "
          f"{len(rows) - finished - none - unfinished} stopped")


def main():
    itr, *words = sys.argv[1:]
    options = read_options(words)
    if options.collect:
        collect(options.collect)
    else:
        plan(itr, options)


if __name__ == "__main__":
    main()
