#!/usr/bin/python3
# SPDX-License-Identifier: MIT
"""Compares two builds on the scenes of ../paper/run.py: processor seconds of the steps without output, Newton iterations, and
the last step's energy.

python3 verification/newton/against.py BEFORE NOW [--shared ../shared] [--results DIR] [--repeats 3] [--case PART-OF-NAME]...

BEFORE and NOW are itr commands, each beside its solver modules. Each scene runs with both in turn on one thread, and every
frame is certified; of repeated runs the fastest counts. A scene's ratio is the seconds of NOW over those of BEFORE. Scenes
of less than 20 ms are not timed. The exit status is 1 if a run of NOW stops or is not certified.
"""
import argparse
import json
import pathlib
import statistics
import sys

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parent.parent
sys.path.insert(0, str(HERE.parent))
from paper import run as paper  # noqa: E402

LEAST_SECONDS = 0.02


def compare(case, options):
    """The fastest rows of both builds."""
    best = {}
    for _ in range(options.repeats):
        for name in ("before", "now"):
            ways = argparse.Namespace(itr=getattr(options, name).resolve(), shared=options.shared, results=options.results / name)
            row = paper.run((*case[:3], None), ways)
            lines = open(paper.folder_of(case[0], ways) / "steps.jsonl")
            row["seconds"] = sum(json.loads(line)["processor_seconds"] for line in lines)
            if name not in best or row["seconds"] < best[name]["seconds"]:
                best[name] = row
    return best["before"], best["now"]


def line(before, now):
    is_timed = before["seconds"] >= LEAST_SECONDS
    ratio = f"{now['seconds'] / before['seconds']:.2f}" if is_timed else ""
    end = ", ".join(text for text, holds in (("stopped", not now["finished"]), ("not certified", not now["certified"])) if holds)
    return (f"| {now['case']} | {end or 'finished, certified'} | {before['seconds']:.2f} → {now['seconds']:.2f} | {ratio} "
            f"| {before['newton']} → {now['newton']} | {before['energy_total']:.6g} → {now['energy_total']:.6g} |")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("before", type=pathlib.Path)
    parser.add_argument("now", type=pathlib.Path)
    parser.add_argument("--shared", type=pathlib.Path, default=ROOT.parent / "shared")
    parser.add_argument("--results", type=pathlib.Path, default=ROOT / "build/against")
    parser.add_argument("--repeats", type=int, default=1)
    parser.add_argument("--case", action="append")
    options = parser.parse_args()
    cases = [case for case in paper.CASES if not options.case or any(part in case[0] for part in options.case)]
    pairs = [compare(case, options) for case in cases]
    print("| scene | end | processor s | ratio | iterations | energy, last step [J] |\n|---|---|---|---|---|---|")
    for before, now in pairs:
        print(line(before, now))
    ratios = [now["seconds"] / before["seconds"] for before, now in pairs if before["seconds"] >= LEAST_SECONDS]
    if ratios:
        print(f"\nMedian ratio of {len(ratios)} scenes: {statistics.median(ratios):.2f}")
    return 0 if all(now["finished"] and now["certified"] for _, now in pairs) else 1


if __name__ == "__main__":
    sys.exit(main())
