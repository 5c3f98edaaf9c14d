# SPDX-License-Identifier: MIT
"""Shared by the studies of examples: runs with their certificates, curves, tables of pages, and decks of CalculiX (`ccx`, Debian's
calculix-ccx) with quadrilaterals of second order."""
import csv
import json
import subprocess

import numpy as np


def run(itr, scene, folder, *words):
    subprocess.run([itr, "run", scene, "-o", folder, "--overwrite", "--threads", "1", *words], check=True, capture_output=True)


def certified(itr, folder):
    """summary.json of a run that passes its certificate."""
    subprocess.run([itr, "certify", folder], check=True, capture_output=True)
    return json.loads((folder / "summary.json").read_text())


def rows(path, name):
    """Rows of a curve: column -> number."""
    with open(path, newline="") as file:
        return [{key: float(value) for key, value in row.items() if key != "name" and value} for row in csv.DictReader(file)
                if row["name"] == name]


def write_table(page, table):
    begin, end = "<!-- table -->\n", "\n<!-- end -->"
    before, rest = page.read_text().split(begin)
    page.write_text(before + begin + table + end + rest.split(end)[1])


def quadratic_grid(xs, ys, keep=None):
    """Nodes of a grid, and quadrilaterals of 8 nodes: corners counter-clockwise from the lowest, then middles."""
    fine_x, fine_y = (np.sort(np.concatenate([v, (v[1:] + v[:-1]) / 2])) for v in (np.asarray(xs, float), np.asarray(ys, float)))
    number = np.arange(len(fine_x) * len(fine_y)).reshape(len(fine_x), len(fine_y)) + 1
    cells = []
    for i in range(0, len(fine_x) - 1, 2):
        for j in range(0, len(fine_y) - 1, 2):
            if keep is None or keep(fine_x[i + 1], fine_y[j + 1]):
                at = [(0, 0), (2, 0), (2, 2), (0, 2), (1, 0), (2, 1), (1, 2), (0, 1)]
                cells.append([number[i + a, j + b] for a, b in at])
    used = {n for cell in cells for n in cell}
    return {n: (x, y) for n, (x, y) in zip(number.ravel(), ((x, y) for x in fine_x for y in fine_y)) if n in used}, cells


def section(nodes, cells, kind):
    lines = ["*NODE, NSET=ALL"] + [f"{n}, {x:.12g}, {y:.12g}, 0" for n, (x, y) in nodes.items()]
    lines.append(f"*ELEMENT, TYPE={kind}, ELSET=BODY")
    return lines + [f"{k + 1}, " + ", ".join(map(str, cell)) for k, cell in enumerate(cells)]


def run_calculix(folder, name, lines, columns):
    """The rows of the .dat file that have so many numbers."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / f"{name}.inp").write_text("\n".join(lines) + "\n")
    subprocess.run(["ccx", "-i", name], cwd=folder, check=True, capture_output=True)
    found = []
    for line in (folder / f"{name}.dat").read_text().splitlines():
        try:
            found.append([float(word) for word in line.split()])
        except ValueError:  # a head
            continue
    return [row for row in found if len(row) == columns]
