# SPDX-License-Identifier: MIT
"""Axisymmetric parts without contact as decks of CalculiX, with reduced integration, which does not lock."""
import numpy as np

from studies import quadratic_grid, run_calculix, section

WEDGES = 180  # of which CalculiX solves one

LAWS = {
    "Ogden": lambda m: (f"OGDEN,N={len(m['mus'])}", [x for mu, a in zip(m["mus"], m["alphas"]) for x in (mu * a / 2, a)]
                        + [2 / m["K"]] + [1e20] * (len(m["mus"]) - 1)),
    "NeoHookean": lambda m: ("NEO HOOKE", [m["E"] / (4 * (1 + m["nu"])), 6 * (1 - 2 * m["nu"]) / m["E"]]),
}


def deck(place, counts, material, moves):
    grid, cells = quadratic_grid(*(np.arange(count + 1) for count in counts))
    lines = section(dict(zip(grid, place(np.array(list(grid.values())) / counts))), cells, "CAX8R")
    for k, ((axis, end), _) in enumerate(moves):
        lines += [f"*NSET, NSET=SIDE{k}"] + [f"{n}," for n, at in grid.items() if at[axis] == counts[axis] * end]
    law, numbers = LAWS[material["type"]](material)
    lines += ["*MATERIAL, NAME=RUBBER", f"*HYPERELASTIC, {law}"]
    lines += [", ".join(f"{v:.9g}" for v in numbers[k:k + 8]) for k in range(0, len(numbers), 8)]
    lines += ["*SOLID SECTION, ELSET=BODY, MATERIAL=RUBBER"]
    lines += ["*STEP, NLGEOM, INC=1000", "*STATIC", "0.05, 1., 1e-6, 0.1", "*BOUNDARY"]
    for k, (_, move) in enumerate(moves):
        lines += [f"SIDE{k}, {c + 1}, {c + 1}, {value:g}" for c, value in enumerate(move)]
    return lines + ["*NODE PRINT, NSET=SIDE0, TOTALS=ONLY", "RF", "*END STEP"]


def axial_reaction(folder, place, counts, material, moves):
    """On the first side of `moves` at the end [N]. `place` maps the unit square, of counts[0] x counts[1] elements, to the
    section. `moves`: of sides, as (axis, end), the displacement."""
    return WEDGES * run_calculix(folder, "part", deck(place, counts, material, moves), 3)[-1][1]
