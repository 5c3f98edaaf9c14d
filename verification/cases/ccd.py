# SPDX-License-Identifier: MIT
"""Continuous collision detection on queries with known answers."""
from harness.suite import Result

TITLE = "Collision queries"
QUANTITY = "collisions missed; times of 0 for primitives that start apart; false positives by queries without a collision"
REFERENCE = "exact answers of the data set of Wang et al. 2021"
TOLERANCE = "no miss, no zero; false positives 2 %, as sharp as it can be and as a simulation asks"
NEEDS = ()

MOST = {"sharp": 0.02, "product": 0.02}


def results(context):
    for line in context.call("ccd_queries", context.data("ccd-queries")).splitlines():
        words = line.split()
        setting, kind, count, missed, zeros, positives, negatives, nanoseconds = \
            *words[:2], *(int(words[k]) for k in (2, 4, 6, 10, 14, 15))
        yield Result(f"{setting}, {kind}, missed", missed, 0, missed,
                     note=f"{count} queries, {positives} false positives of {negatives}, {nanoseconds} ns each")
        yield Result(f"{setting}, {kind}, zero when separated", zeros, 0, zeros)
        if kind == "all":
            yield Result(f"{setting}, share of false positives", positives / negatives, MOST[setting], positives)
