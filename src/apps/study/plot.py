# SPDX-License-Identifier: MIT
"""Draws the work-precision diagrams of a study: each kind of error against each cost, a line for each series."""

import io

import matplotlib
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullLocator
from plan import ALL_SERIES
from results import COSTS, MEASURES

# Texts stay texts, and one study has one file.
matplotlib.rcParams.update({"svg.fonttype": "none", "svg.hashsalt": "itr", "font.size": 8, "lines.markersize": 4})
COLOURS = ("#000000", "#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#8c510a", "#6a3d9a", "#999999", "#b15928")


def line_of(results, name, measure, cost):
    """Costs and errors of a series, the largest error first."""
    rows = (row for row in results.rows if row.run.series.name == name)
    found = ((getattr(row, cost), results.told_error(row, measure) or 0) for row in rows)
    return sorted((point for point in found if min(point) > 0), key=lambda point: -point[1])


def make_svg(results):
    """Each line has the id SERIES-MEASURE-COST, by which `itr report` finds its points."""
    names = [name for name, series in ALL_SERIES.items() if series.varies_mesh]
    shown = [m for m in MEASURES if any(line_of(results, name, m, "processor_seconds") for name in names)]
    figure = Figure(figsize=(10.5, max(1, 2.6 * len(shown))), layout="constrained")
    keys = {}
    for place, (measure, cost) in enumerate(((measure, cost) for measure in shown for cost in COSTS), start=1):
        axes = figure.add_subplot(len(shown), len(COSTS), place, xscale="log", yscale="log")
        axes.set(xlabel=COSTS[cost], ylabel=f"{measure.name} error" + (f", {measure.unit}" if measure.unit else ""))
        axes.grid(color="#dddddd")
        for axis in (axes.xaxis, axes.yaxis):
            axis.set(major_locator=LogLocator(subs=(1, 2, 5)), major_formatter="{x:.3g}", minor_locator=NullLocator())
        if own := results.worth and results.worth[measure.name]:
            keys["what the reference is worth"] = axes.axhline(own, color="#8a4b00", linestyle="--", linewidth=0.8)
        for k, name in enumerate(names):
            if points := line_of(results, name, measure, cost):
                (line,) = axes.plot(*zip(*points), "o-", color=COLOURS[k % len(COLOURS)], gid=f"{name}-{measure.name}-{cost}")
                keys[f"{name}: {ALL_SERIES[name].what}"] = line
    figure.legend(keys.values(), keys.keys(), loc="upper left", bbox_to_anchor=(0, 0), frameon=False)
    text = io.StringIO()
    figure.savefig(text, format="svg", metadata={"Date": None}, bbox_inches="tight")
    return text.getvalue()[text.getvalue().index("<svg") :]  # stands in pages too, where a prolog cannot
