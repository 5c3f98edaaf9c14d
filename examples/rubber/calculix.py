# SPDX-License-Identifier: MIT
"""Axisymmetric parts without contact as decks of CalculiX (`ccx`, Debian's calculix-ccx), of quadrilaterals of second order
with reduced integration, which do not lock: what study.py compares with."""
import re
import subprocess

import numpy as np

WEDGES = 180  # of which CalculiX solves one

LAWS = {
    "Ogden": lambda m: (f"OGDEN,N={len(m['mus'])}", [x for mu, a in zip(m["mus"], m["alphas"]) for x in (mu * a / 2, a)]
                        + [2 / m["K"]] + [1e20] * (len(m["mus"]) - 1)),
    "NeoHookean": lambda m: ("NEO HOOKE", [m["E"] / (4 * (1 + m["nu"])), 6 * (1 - 2 * m["nu"]) / m["E"]]),
}


def deck(place, counts, material, moves):
    nx, ny = 2 * counts[0], 2 * counts[1]
    grid = [(i, j) for j in range(ny + 1) for i in range(nx + 1) if i % 2 == 0 or j % 2 == 0]
    number = {at: k + 1 for k, at in enumerate(grid)}
    lines = ["*NODE"]
    lines += [f"{k + 1}, {x:.12g}, {y:.12g}, 0" for k, (x, y) in enumerate(place(np.array(grid) / [nx, ny]))]
    lines += ["*ELEMENT, TYPE=CAX8R, ELSET=PART"]
    around = ((0, 0), (2, 0), (2, 2), (0, 2), (1, 0), (2, 1), (1, 2), (0, 1))
    for e in range(counts[0] * counts[1]):
        i, j = 2 * (e % counts[0]), 2 * (e // counts[0])
        lines.append(", ".join(str(n) for n in [e + 1] + [number[i + a, j + b] for a, b in around]))
    for k, ((axis, end), _) in enumerate(moves):
        lines += [f"*NSET, NSET=SIDE{k}", *(f"{n}," for at, n in number.items() if at[axis] == (nx, ny)[axis] * end)]
    law, numbers = LAWS[material["type"]](material)
    lines += ["*MATERIAL, NAME=RUBBER", f"*HYPERELASTIC, {law}"]
    lines += [", ".join(f"{v:.9g}" for v in numbers[k:k + 8]) for k in range(0, len(numbers), 8)]
    lines += ["*SOLID SECTION, ELSET=PART, MATERIAL=RUBBER"]
    lines += ["*STEP, NLGEOM, INC=1000", "*STATIC", "0.05, 1., 1e-6, 0.1", "*BOUNDARY"]
    for k, (_, move) in enumerate(moves):
        lines += [f"SIDE{k}, {c + 1}, {c + 1}, {value:g}" for c, value in enumerate(move)]
    return "\n".join([*lines, "*NODE PRINT, NSET=SIDE0, TOTALS=ONLY", "RF", "*END STEP", ""])


def axial_reaction(folder, place, counts, material, moves):
    """On the first side of `moves` at the end [N]. `place` maps the unit square, of counts[0] x counts[1] elements, to the
    section. `moves`: of sides, as (axis, end), the displacement."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "part.inp").write_text(deck(place, counts, material, moves))
    run = subprocess.run(["ccx", "part"], cwd=folder, capture_output=True, text=True)
    totals = re.findall(r"total force.*?time\s+(\S+)\s*\n\s*\n\s*\S+\s+(\S+)\s+\S+", (folder / "part.dat").read_text())
    if not totals or abs(float(totals[-1][0]) - 1) > 1e-6:
        raise SystemExit(f"{folder}: ccx stopped before the end\n{run.stdout[-500:]}")
    return WEDGES * float(totals[-1][1])
