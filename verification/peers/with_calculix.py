# SPDX-License-Identifier: MIT
"""Problems as decks of CalculiX: contact from surface to surface by a penalty, a rigid plane as an element whose nodes are held."""
import re

import numpy as np

from problem import facets_in, nodes_and_cells, nodes_of

KINDS = {("plane strain", 1): "CPE3", ("plane strain", 2): "CPE6", ("axisymmetric", 1): "CAX3", ("axisymmetric", 2): "CAX6",
         ("solid", 1): "C3D4", ("solid", 2): "C3D10"}
PLATES = {"plane strain": "CPE4", "axisymmetric": "CAX4", "solid": "C3D8"}
WEDGES = 180  # of an axisymmetric body, of which CalculiX gives the forces of one


def law(material):
    E, nu = material["E"], material["nu"]
    if material["type"] == "IsochoricNeoHooke":
        return ["*HYPERELASTIC, NEO HOOKE", f"{E / 4 / (1 + nu):.12g}, {6 * (1 - 2 * nu) / E:.12g}"]
    return ["*ELASTIC", f"{E:.9g}, {nu:.9g}"]


def chunks(name, numbers):
    return [f"*NSET, NSET={name}"] + [f"{n}," for n in numbers]


class Deck:
    def __init__(self, problem, order):
        self.problem, self.order = problem, order
        self.lines, self.first, self.first_cell, nodes, cells = [], [], [], 0, 0
        for k, body in enumerate(problem.bodies):
            points, of_body = nodes_and_cells(body, order)
            self.first.append(nodes + 1)
            self.first_cell.append(cells + 1)
            self.lines += elements(nodes + 1, points, cells + 1, of_body, KINDS[problem.section, order], f"B{k}")
            nodes, cells = nodes + len(points), cells + len(of_body)
        self.plate = None
        if any(contact.master is None for contact in problem.contacts):
            self.plate = self.add_plate(nodes + 1, cells + 1)

    def add_plate(self, node, cell):
        """Numbers of the nodes of the plane's element."""
        problem, low = self.problem, -0.1 * self.problem.length
        if problem.dim == 2:
            left = 1e-4 * problem.length if problem.section == "axisymmetric" else -problem.length
            corners = [(left, low), (problem.length, low), (problem.length, 0), (left, 0)]
        else:
            square = [(-1, -1), (1, -1), (1, 1), (-1, 1)]
            corners = [(x * problem.length, y * problem.length, z) for z in (low, 0) for x, y in square]
        self.lines += elements(node, np.array(corners, float), cell, [range(len(corners))], PLATES[problem.section], "PLATE")
        self.lines += ["*SURFACE, NAME=PLANE", f"{cell}, S{3 if problem.dim == 2 else 2}"]
        return range(node, node + len(corners))

    def materials(self):
        for k, body in enumerate(self.problem.bodies):
            self.lines += [f"*MATERIAL, NAME=M{k}", *law(body.material), f"*SOLID SECTION, ELSET=B{k}, MATERIAL=M{k}",
                           "1" if self.problem.section == "plane strain" else ""]
        if self.plate:
            self.lines += ["*MATERIAL, NAME=RIGID", "*ELASTIC", f"{100 * self.problem.bodies[0].material['E']}, 0.3",
                           "*SOLID SECTION, ELSET=PLATE, MATERIAL=RIGID", "1" if self.problem.section == "plane strain" else ""]

    def surfaces(self, stiffness, stick):
        for k, contact in enumerate(self.problem.contacts):
            sides = [(f"SLAVE{k}", contact.slave, contact.box)]
            sides += [(f"MASTER{k}", contact.master, contact.master_box)] if contact.master is not None else []
            for name, number, box in sides:
                where, _ = facets_in(self.problem.bodies[number], box)
                self.lines += [f"*SURFACE, NAME={name}"] + [f"{self.first_cell[number] + c}, S{f + 1}" for c, f in where]
        self.lines += ["*SURFACE INTERACTION, NAME=TOUCH", "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR", f"{stiffness:.9g}"]
        if self.problem.friction:
            self.lines += ["*FRICTION", f"{self.problem.friction}, {stick:.9g}"]
        for k, contact in enumerate(self.problem.contacts):
            master = "PLANE" if contact.master is None else f"MASTER{k}"
            self.lines += ["*CONTACT PAIR, INTERACTION=TOUCH, TYPE=SURFACE TO SURFACE", f"SLAVE{k}, {master}"]

    def sets(self):
        for k, held in enumerate(self.problem.held):
            body = self.problem.bodies[held.body]
            self.lines += chunks(f"H{k}", self.first[held.body] + nodes_of(body, self.order, held.box))
            for axis, value in held.values.items():
                if isinstance(value, list):
                    self.lines += [f"*AMPLITUDE, NAME=A{k}{axis}"] + [f"{t:.9g}, {v:.9g}" for t, v in value]
        if self.plate:
            self.lines += chunks("HPLATE", self.plate)
        for name, (body, at, _) in self.problem.points.items():
            points, _ = nodes_and_cells(self.problem.bodies[body], self.order)
            self.lines += chunks(name.upper(), [self.first[body] + np.linalg.norm(points - np.array(at), axis=1).argmin()])

    def step(self, increments):
        is_small = all(b.material["type"] == "LinearElasticity" for b in self.problem.bodies)
        self.lines += ["*STEP, INC=100000" + ("" if is_small else ", NLGEOM"), "*STATIC" + increments]
        for k, held in enumerate(self.problem.held):
            for axis, value in held.values.items():
                curve = isinstance(value, list)
                self.lines += ["*BOUNDARY" + (f", AMPLITUDE=A{k}{axis}" if curve else ""),
                               f"H{k}, {axis + 1}, {axis + 1}, {1 if curve else value:.12g}"]
        if self.plate:
            self.lines += ["*BOUNDARY", f"HPLATE, 1, {self.problem.dim}"]
        for load in self.problem.loads:
            self.lines += self.load(load)
        for k in sorted({index for index, _ in self.problem.reactions.values()}):
            self.lines += [f"*NODE PRINT, NSET=H{k}, TOTALS=ONLY", "RF"]
        for name in self.problem.points:
            self.lines += [f"*NODE PRINT, NSET={name.upper()}", "U"]
        self.lines.append("*END STEP")

    def load(self, load):
        """A dead traction as forces on nodes; around an axis, where facets are level, as their pressure."""
        body = self.problem.bodies[load.body]
        where, corners = facets_in(body, load.box)
        if self.problem.section == "axisymmetric":
            return ["*DLOAD"] + [f"{self.first_cell[load.body] + c}, P{f + 1}, {-load.traction[-1]:.12g}" for c, f in where]
        points, cells = nodes_and_cells(body, self.order)
        shares = (0.5, 0.5) if self.order == 1 else (1 / 6, 1 / 6, 2 / 3)  # of the ends, and of the middle of a straight edge
        forces = {}
        for (c, f), ends in zip(where, corners):
            length = np.linalg.norm(points[ends[1]] - points[ends[0]])
            nodes = [*ends] + ([cells[c][3 + f]] if self.order == 2 else [])
            for node, share in zip(nodes, shares):
                forces[node] = forces.get(node, 0) + share * length * np.array(load.traction)
        return ["*CLOAD"] + [f"{self.first[load.body] + n}, {axis + 1}, {force[axis]:.12g}"
                             for n, force in forces.items() for axis in range(2) if force[axis]]


def elements(node, points, cell, cells, kind, name):
    padded = np.pad(points, ((0, 0), (0, 3 - points.shape[1])))
    lines = ["*NODE"] + [f"{node + k}, " + ", ".join(f"{c:.12g}" for c in point) for k, point in enumerate(padded)]
    lines.append(f"*ELEMENT, TYPE={kind}, ELSET={name}")
    return lines + [f"{cell + k}, " + ", ".join(str(node + n) for n in one) for k, one in enumerate(cells)]


def write(problem, folder, order, settings):
    """Settings: `stiffness` of the contact, `stick` of friction, and `increments`, what follows *STATIC."""
    deck = Deck(problem, order)
    deck.materials()
    deck.surfaces(settings["stiffness"], settings.get("stick", settings["stiffness"]))
    deck.sets()
    deck.step(settings["increments"])
    (folder / "deck.inp").write_text("\n".join(deck.lines) + "\n")


def command(_, folder):
    return ["ccx", "-i", "deck"]


HEAD = re.compile(r"(total force|displacements) .* for set (\w+) and time\s+(\S+)")


def read(problem, folder):
    found, name, time = {}, None, None
    for line in (folder / "deck.dat").read_text().splitlines():
        if head := HEAD.search(line):
            name, time = head[2], float(head[3])
        elif name and line.strip():
            found.setdefault(name, []).append((time, [float(x) for x in line.split()[-3:]]))
            name = None
    curves = {}
    for curve, (index, axis) in problem.reactions.items():
        rows = found[f"H{index}"]
        curves["t"], values = np.array([t for t, _ in rows]), np.array([v[axis] for _, v in rows])
        curves[curve] = values * (WEDGES if problem.section == "axisymmetric" else 1)
    for curve, (_, _, axis) in problem.points.items():
        rows = found[curve.upper()]
        curves["t"], curves[curve] = np.array([t for t, _ in rows]), np.array([v[axis] for _, v in rows])
    lines = [line.split() for line in (folder / "deck.sta").read_text().splitlines() if re.match(r"\s+\d", line)]
    return curves, sum(int(words[3]) for words in lines), len({tuple(w[:2]) for w in lines})
