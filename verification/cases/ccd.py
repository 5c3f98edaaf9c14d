# SPDX-License-Identifier: MIT
"""Continuous collision detection on queries with known answers."""
from harness.suite import Result

TITLE = "Collision queries"
QUANTITY = "collisions missed; times of 0 for primitives that start apart; false positives"
REFERENCE = "exact answers of the data set of Wang et al. 2021"
TOLERANCE = "no miss, no zero; 2 % false positives"
NEEDS = ()


def results(context):
    for line in context.call("ccd_queries", context.data("ccd-queries")).splitlines():
        words = line.split()
        kind, count, missed, positives, zeros, nanoseconds = words[0], *(int(words[k]) for k in (1, 3, 5, 8, 12))
        yield Result(f"{kind}, missed", missed, 0, missed, note=f"{count} queries, {positives} false positives, {nanoseconds} ns each")
        yield Result(f"{kind}, zero when separated", zeros, 0, zeros)
        if kind == "all":
            yield Result("share of false positives", positives / count, 0.02, positives)
