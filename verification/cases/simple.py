# SPDX-License-Identifier: MIT
"""Simple scenes, drawn at random, against the right value of each. The quick suite draws the same ones each time."""
import collections
import pathlib
import secrets
import sys

from harness.suite import Result

TITLE = "Simple scenes"
QUANTITY = "how many of the scenes that a generator draws stop, are off without a word, or are off by more than 1 %"
REFERENCE = "linear systems of the same mesh and integrator, rigid motion, conservation (verification/stability)"
TOLERANCE = "none, none, 5 of 100"
NEEDS = ("numpy", "scipy", "h5py")

QUICK_SEED, QUICK_COUNT, COUNT = 44, 200, 2000


def results(context):
    sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "stability"))
    import simple
    seed, count = (QUICK_SEED, QUICK_COUNT) if context.quick else (secrets.randbelow(10**6), COUNT)
    rows = list(simple.drawn(seed, count, context.build / "bin/itr", context.folder))
    simple.write_results(context.folder, rows, seed)
    context.table("kinds", simple.COLUMNS, simple.by_kind(rows))
    by_verdict = collections.defaultdict(list)
    for row in rows:
        by_verdict[row.verdict].append(row)
    for verdict in ("stopped", "wrong without a word"):
        found = by_verdict[verdict]
        names = ", ".join(f"{row.number} ({row.kind})" for row in found[:5])
        note = f"simple.py --seed {seed} --only {names}" if found else f"of {count}, seed {seed}"
        yield Result(verdict, len(found), 0, note=note)
    yield Result("not within 1 %", 1 - len(by_verdict["right"]) / count, 0.05, note=f"of {count}, seed {seed}")
