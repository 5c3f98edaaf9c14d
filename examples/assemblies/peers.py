# SPDX-License-Identifier: MIT
"""Decks of CalculiX for assemblies: quadrilaterals of second order where ITR has triangles."""
import math

import numpy as np

import make
from studies import quadratic_grid, run_calculix, section


def neo_hooke(E, nu):
    """C10 and D1 of CalculiX."""
    return f"{E / 4 / (1 + nu):.9g}, {6 * (1 - 2 * nu) / E:.9g}"


def rubber_mount(folder, refine):
    """How far the top goes down by 500 N."""
    half = 8 * refine
    xs = np.concatenate([make.span(0, 20, half), make.span(20, 22, refine)[1:]])
    ys = np.concatenate([make.span(-3, 0, refine), make.span(0, 15, half)[1:], make.span(15, 18, refine)[1:]])
    nodes, cells = quadratic_grid(xs, ys, keep=lambda x, y: x < 20 or not 0 < y < 15)
    middle = {k + 1: np.mean([nodes[n] for n in cell[:4]], axis=0) for k, cell in enumerate(cells)}
    rubber = [k for k, (x, y) in middle.items() if 0 < y < 15]
    lines = section(nodes, cells, "CAX8R")
    for name, chosen in (("RUBBER", rubber), ("STEEL", [k for k in middle if k not in set(rubber)])):
        lines += [f"*ELSET, ELSET={name}"] + [f"{k}," for k in chosen]
    top = [k + 1 for k, cell in enumerate(cells) if nodes[cell[3]][1] == ys[-1]]
    lines += ["*NSET, NSET=FOOT"] + [f"{n}," for n, (x, y) in nodes.items() if y == -3]
    lines += ["*NSET, NSET=AXIS"] + [f"{n}," for n, (x, y) in nodes.items() if x == 0]
    lines += ["*NSET, NSET=TOP"] + [f"{n}," for n, (x, y) in nodes.items() if x == 0 and y == ys[-1]]
    lines += ["*MATERIAL, NAME=RUBBER", "*HYPERELASTIC, NEO HOOKE", neo_hooke(make.RUBBER["E"], make.RUBBER["nu"]),
              "*MATERIAL, NAME=STEEL", "*ELASTIC", f"{make.STEEL['E']}, {make.STEEL['nu']}",
              "*SOLID SECTION, ELSET=RUBBER, MATERIAL=RUBBER", "", "*SOLID SECTION, ELSET=STEEL, MATERIAL=STEEL", "",
              "*BOUNDARY", "FOOT, 1, 2", "AXIS, 1, 1", "*STEP, NLGEOM, INC=100", "*STATIC", "0.25, 1", "*DLOAD"]
    lines += [f"{k}, P3, {500 / (math.pi * 22**2):.9g}" for k in top]
    lines += ["*NODE PRINT, NSET=TOP", "U", "*END STEP"]
    return -run_calculix(folder, f"mount{refine}", lines, 4)[-1][2]


def gripper(folder, refine, pressures):
    """The forces on the disc under pressures of t = 0.1, 0.2, ... as ITR has found them in the gas."""
    nodes, cells = quadratic_grid(*make.finger_lines(refine), keep=make.is_finger)
    first = max(nodes) + 1
    round_, ring = quadratic_grid(make.span(0, 360, 48 * refine), make.span(make.DISC_RADIUS - 1, make.DISC_RADIUS, 1))
    disc = {n + first: (make.DISC[0] + r * math.cos(math.radians(a)), make.DISC[1] - r * math.sin(math.radians(a)))
            for n, (a, r) in round_.items()}
    lines = section(nodes | disc, cells + [[n + first for n in cell] for cell in ring], "CPE8R")

    def faces(where):
        """(cell, face) of the finger where the middle is."""
        return [(k + 1, f + 1) for k, cell in enumerate(cells) for f in range(4) if where(*nodes[cell[4 + f]])]

    inner = faces(lambda x, y: 0 < x < 60 and ((y in (2, 13) and 1.5 < x % 10 < 7.5) or (2 < y < 13 and x % 10 in (1.5, 7.5))))
    surfaces = {"BOTTOM": faces(lambda x, y: y == 0), "DISC": [(len(cells) + k + 1, 3) for k in range(len(ring))]}
    pairs = [("BOTTOM", "DISC")]
    for k in range(5):
        for name, place in ((f"RIGHT{k}", 10 * k + 9), (f"LEFT{k}", 10 * k + 10)):
            surfaces[name] = faces(lambda x, y, place=place: x == place and 2 < y)
        pairs.append((f"RIGHT{k}", f"LEFT{k}"))
    for name, chosen in surfaces.items():
        lines += [f"*SURFACE, NAME={name}"] + [f"{k}, S{face}" for k, face in chosen]
    strip = [k + 1 for k, cell in enumerate(cells) if nodes[cell[4]][1] < 2]
    for name, chosen in (("STRIP", strip), ("WALLS", sorted(set(range(1, len(cells) + 1)) - set(strip))),
                         ("RIGID", range(len(cells) + 1, len(cells) + len(ring) + 1))):
        lines += [f"*ELSET, ELSET={name}"] + [f"{k}," for k in chosen]
    for name, E in (("STRIP", 5), ("WALLS", make.SILICONE["E"])):
        lines += [f"*MATERIAL, NAME={name}", "*HYPERELASTIC, NEO HOOKE", neo_hooke(E, make.SILICONE["nu"]),
                  f"*SOLID SECTION, ELSET={name}, MATERIAL={name}", "1"]
    lines += ["*MATERIAL, NAME=RIGID", "*ELASTIC", "1000, 0.3", "*SOLID SECTION, ELSET=RIGID, MATERIAL=RIGID", "1"]
    lines += ["*SURFACE INTERACTION, NAME=TOUCH", "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR", "5"]
    for pair in pairs:
        lines += ["*CONTACT PAIR, INTERACTION=TOUCH, TYPE=SURFACE TO SURFACE", ", ".join(pair)]
    lines += ["*NSET, NSET=ROOT"] + [f"{n}," for n, (x, y) in nodes.items() if x == -4]
    lines += ["*NSET, NSET=HELD"] + [f"{n}," for n in disc]
    lines += ["*AMPLITUDE, NAME=GAS", "0, 0"] + [f"{(k + 1) / len(pressures):.6g}, {p:.9g}" for k, p in enumerate(pressures)]
    lines += ["*BOUNDARY", "ROOT, 1, 2", "HELD, 1, 2", "*STEP, NLGEOM, INC=1000", "*STATIC", "0.02, 1, 1e-7, 0.05",
              "*DLOAD, AMPLITUDE=GAS"] + [f"{k}, P{face}, 1" for k, face in inner]
    lines += ["*NODE PRINT, NSET=HELD, TOTALS=ONLY", "RF", "*END STEP"]
    return run_calculix(folder, f"gripper{refine}", lines, 3)[-1][:2]


TRAVEL = 2.75  # mm, to just before the end of the slope


def snap_hook(folder, refine):
    """Travel and force of the end of a hook whose slope is moved over the corner of the catch."""
    columns, rows = make.hook_lines(refine)
    nodes, cells = quadratic_grid(columns, rows, keep=lambda x, y: y > 0 or x > 20)
    first = max(nodes) + 1
    block, quad = quadratic_grid([24, 25], [-1.1, -0.1])
    lines = section({n: make.hook_place(*p) for n, p in nodes.items()} | {n + first: p for n, p in block.items()},
                    cells + [[n + first for n in quad[0]]], "CPE8R")
    under = [k + 1 for k, cell in enumerate(cells) if nodes[cell[4]][1] == rows[0]]
    corner = [n + first for n, p in block.items() if p == (24, -0.1)]
    lines += ["*ELSET, ELSET=HOOK"] + [f"{k + 1}," for k in range(len(cells))] + ["*ELSET, ELSET=CATCH", f"{len(cells) + 1}"]
    lines += ["*MATERIAL, NAME=POM", "*HYPERELASTIC, NEO HOOKE", neo_hooke(make.POM["E"], make.POM["nu"]),
              "*MATERIAL, NAME=RIGID", "*ELASTIC", "1e6, 0.3", "*SOLID SECTION, ELSET=HOOK, MATERIAL=POM", "1",
              "*SOLID SECTION, ELSET=CATCH, MATERIAL=RIGID", "1",
              "*NSET, NSET=END"] + [f"{n}," for n, (x, y) in nodes.items() if x == 0 and y >= 0]
    lines += ["*NSET, NSET=HELD"] + [f"{n + first}," for n in block]
    lines += ["*SURFACE, NAME=CORNER, TYPE=NODE", f"{corner[0]}", "*SURFACE, NAME=UNDER"] + [f"{k}, S1" for k in under]
    lines += ["*SURFACE INTERACTION, NAME=TOUCH", "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR", "1e5", "*FRICTION", "0.3, 1e4",
              "*CONTACT PAIR, INTERACTION=TOUCH, TYPE=NODE TO SURFACE", "CORNER, UNDER",
              "*BOUNDARY", "HELD, 1, 2", "END, 2, 2", "*STEP, NLGEOM, INC=10000", "*STATIC, DIRECT", "0.01, 1",
              "*BOUNDARY", f"END, 1, 1, {TRAVEL}", "*NODE PRINT, NSET=END, TOTALS=ONLY", "RF", "*END STEP"]
    forces = np.array(run_calculix(folder, f"hook{refine}", lines, 3))[:, 0]
    return np.linspace(TRAVEL / len(forces), TRAVEL, len(forces)), forces
