#!/usr/bin/python3
# SPDX-License-Identifier: MIT
"""When remeshing pays: README's table, from studies.md, and its figure, from the studies' CSV files.

usage: worth.py            prints the table
       worth.py --figure   also writes worth.svg: error against seconds of three scenes
"""

import csv
import pathlib
import sys

HERE = pathlib.Path(__file__).resolve().parent

ROWS = [  # study, error, the scene in words, why
    ("masticator-2d", "L2", "beam between moving teeth, 2D", "bending and contact are local"),
    ("ball-wall-3d", "H1", "impact of a ball, 3D", "contact is local"),
    ("masticator-3d", "L2", "beam between moving teeth, 3D", "bending is smooth"),
    ("cantilever", "L2", "Cook's membrane, 2D", "the solution is smooth but for one corner"),
    ("spikes2d", "L2", "bar dropped on spikes, 2D", "contact is local"),
    ("ball-wall-2d", "L2", "impact of a ball, 2D", "waves fill the whole body"),
]
PANELS = [  # study, title
    ("masticator-2d", "hardly pays: beam between teeth, 2D"),
    ("ball-wall-3d", "pays: impact of a ball, 3D"),
    ("cantilever", "does not: Cook's membrane, 2D"),
]
LINEAR = ("itr", "swaps", "smoothing")
SERIES = {"uniform": ("uniform refinement", "#777777", "s"), "itr": ("remeshed", "#b30000", "o")}


def studies():
    """(study, error) -> the row of studies.md with linear elements: time and unknowns of remeshing by those of uniform refinement."""
    rows = {}
    for line in (HERE / "studies.md").read_text().splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if line.startswith("| [") and len(cells) == 8 and cells[2] in LINEAR:
            name = cells[0].partition("]")[0].lstrip("[")
            rows[name, cells[1]] = {"time": cells[4], "unknowns": cells[6], "is_recommended": cells[7] != "nothing recommended"}
    return rows


def table():
    """README's six rows."""
    found = studies()
    lines = ["| scene | error | time | unknowns | it pays | because |", "|---|---|---|---|---|---|"]
    for name, error, words, reason in ROWS:
        row = found[name, error]
        highest, lowest = float(row["time"].split()[-1]), float(row["time"].split()[0])
        verdict = "not told" if not row["is_recommended"] else "yes" if highest <= 1 else "no" if lowest > 1 else "hardly"
        lines.append(f"| [{words}](verification/paper/{name}/study.md) | {error} | {row['time']} | {row['unknowns']} | "
                     f"{verdict} | {reason} |")
    return "\n".join(lines)


def points(name, series):
    """(processor seconds, relative L2 error) of the finished runs of a series, in the order of seconds."""
    with open(HERE / name / "study.csv", newline="") as file:
        rows = [row for row in csv.DictReader(file) if row["series"] == series and row["l2"]]
    return sorted((float(row["processor_seconds"]), float(row["l2"])) for row in rows if "from n_refs" not in row["label"])


def figure(path):
    import matplotlib

    matplotlib.use("svg")
    matplotlib.rcParams["svg.hashsalt"] = "itr"  # the same file in each run
    import matplotlib.pyplot as plt

    drawing, axes = plt.subplots(1, len(PANELS), figsize=(10, 3.1), constrained_layout=True)
    for axis, (name, title) in zip(axes, PANELS):
        for series, (label, colour, marker) in SERIES.items():
            axis.loglog(*zip(*points(name, series)), marker=marker, color=colour, label=label)
        axis.set_title(title, fontsize=10)
        axis.set_xlabel("processor seconds")
        axis.grid(True, which="both", alpha=0.2)
    axes[0].set_ylabel("relative L2 error")
    axes[0].legend(frameon=False, fontsize=9)
    drawing.savefig(path, metadata={"Date": None})


if __name__ == "__main__":
    print(table())
    if "--figure" in sys.argv[1:]:
        figure(HERE / "worth.svg")
