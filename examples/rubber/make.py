#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Makes the scenes of rubber parts and their meshes. Units are mm, t and s, so forces are in N and stresses in MPa.

usage: make.py [-o DIR] [--refine K] [SCENE...]

With --refine edges are 2^K times shorter than in the committed meshes. The lip of the shaft seal needs the program gmsh.
"""

import argparse
import dataclasses
import itertools
import json
import pathlib
import subprocess
import sys
import tempfile

import numpy as np

HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent))
from make_meshes import disc, rectangle, write_msh, write_obj  # noqa: E402

# Laws of Brink and Stein's seal, of shear moduli 0.42 and 0.62 MPa.
OGDEN = {"type": "Ogden", "mus": [0.63, 0.0012, -0.01], "alphas": [1.3, 5, -2], "K": 1000}
YEOH = {"type": "Yeoh", "C": [0.31237, 5.4257e-4, 6.962e-5], "K": 1000}
BUSHING = {"type": "NeoHookean", "E": 1.8, "nu": 0.4997}
CORD = 3.53
SECTOR = np.pi / 12  # of the boot
FLUID = "0.6 * min(max(t - 1, 0), 1)"
# Edge, lip and garter side of the shaft seal, its membrane, and the rim that is bonded to a metal ring: r, z, edges by h.
LIP = [(24.4, 0, 0.3), (25.6, -1.4), (27.2, -1.6), (28.2, -1), (28.6, 3.4), (29.2, 5), (32, 5), (32, 7), (28.2, 7),
       (26.8, 5.6), (26.4, 1.6), (25.6, 1)]


def annulus(inner, outer, h):
    """Rings whose edges are about as long as they are wide."""
    rings, around = max(round((outer - inner) / h), 2), round(np.pi * (inner + outer) / h)
    points, ids, cells = [], [], []
    for k, r in enumerate(np.linspace(inner, outer, rings + 1)):
        angle = 2 * np.pi * (np.arange(around) + k % 2 / 2) / around
        ids.append(np.arange(len(points), len(points) + around))
        points += list(r * np.column_stack([np.cos(angle), np.sin(angle)]))
    for k, (a, b) in enumerate(zip(ids, ids[1:])):
        for i in range(around):
            j = (i + 1) % around
            cells += [(a[i], b[i], a[j]), (a[j], b[i], b[j])] if k % 2 == 0 else [(a[i], b[i], b[j]), (a[i], b[j], a[j])]
    return np.array(points), np.array(cells)


def leg(shares):
    """Half of Brink and Stein's seal, of a unit square: 9 mm high, 2.235 mm wide, it leans inwards by 1 in 2."""
    return np.column_stack([6.5 + 2.235 * shares[:, 0] - 4.5 * shares[:, 1], 9 * shares[:, 1]])


def boot(shares):
    """The wall of a boot, of a unit square: collars of radii 14 and 30 mm, between them three convolutions 9 mm deep."""
    z = np.linspace(0, 60, 2001)
    along = np.clip((z - 5) / 50, 0, 1)
    cone, waves = 14 + 16 * (along - np.sin(2 * np.pi * along) / (2 * np.pi)), 4.5 * (1 - np.cos(6 * np.pi * along))
    middle = np.column_stack([cone + waves, z])
    place = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(middle, axis=0), axis=1))])
    tangent = np.gradient(middle, place, axis=0)
    at = shares[:, 1] * place[-1]
    on, way = (np.column_stack([np.interp(at, place, v[:, c]) for c in (0, 1)]) for v in (middle, tangent))
    normal = np.column_stack([way[:, 1], -way[:, 0]]) / np.linalg.norm(way, axis=1)[:, None]
    return on + 1.4 * (shares[:, :1] - 0.5) * normal


def sector(place, along):
    """A wall in a sector about the z axis, one layer of boxes that are two around: each is cut into six tetrahedra around a
    diagonal, as the mirror image of those beside it."""
    counts = (1, 2, along)
    s, turn, t = (v.ravel() for v in np.meshgrid(*(np.linspace(0, 1, n + 1) for n in counts), indexing="ij"))
    r, z = place(np.column_stack([s, t])).T
    points = np.column_stack([r * np.cos(SECTOR * turn), r * np.sin(SECTOR * turn), z])
    ids, cells = np.arange(len(points)).reshape([n + 1 for n in counts]), []
    for box in np.ndindex(*counts):
        for axes in itertools.permutations(np.eye(3, dtype=int)):
            corners = np.cumsum([(0, 0, 0), *axes], axis=0) ^ (np.array(box) % 2)
            cells.append([ids[tuple(box + corner)] for corner in corners])
    cells = np.array(cells)
    a, b, c, d = (points[cells[:, k]] for k in range(4))
    is_turned = np.einsum("ij,ij->i", np.cross(b - a, c - a), d - a) < 0
    cells[is_turned] = cells[is_turned][:, [1, 0, 2, 3]]
    return points, cells


def half_disc(radius, h):
    """The upper half: rings have vertices on the x axis."""
    points, cells = disc(radius, h)
    used, cells = np.unique(cells[points[cells, 1].mean(axis=1) > 0], return_inverse=True)
    points = points[used]
    points[np.abs(points[:, 1]) < 1e-9 * radius, 1] = 0
    return points, cells.reshape(-1, 3)


def mapped(place, width, length, h):
    """A strip of `width` and `length` where `place` puts it."""
    points, cells = rectangle(width, length, h)
    return place(points / [width, length] + 0.5), cells


def polygon(outline, h):
    """By gmsh, with edges of h or, at a corner (x, y, s), of s h."""
    lines = [f"Point({k}) = {{{p[0]}, {p[1]}, 0, {p[2] * h if len(p) > 2 else h}}};" for k, p in enumerate(outline)]
    lines += [f"Line({k}) = {{{k}, {(k + 1) % len(outline)}}};" for k in range(len(outline))]
    lines += [f"Curve Loop(1) = {{{', '.join(str(k) for k in range(len(outline)))}}};", "Plane Surface(1) = {1};"]
    with tempfile.TemporaryDirectory() as folder:
        geo, msh = pathlib.Path(folder) / "part.geo", pathlib.Path(folder) / "part.msh"
        geo.write_text("\n".join(lines) + "\n")
        subprocess.run(["gmsh", geo, "-2", "-v", "0", "-format", "msh22", "-o", msh], check=True)
        words = [line.split() for line in msh.read_text().splitlines()]

    def table(name):
        first = words.index([name]) + 2
        return words[first:first + int(words[first - 1][0])]

    points = np.array([row[1:3] for row in table("$Nodes")], dtype=float)
    used, cells = np.unique([row[-3:] for row in table("$Elements") if row[1] == "2"], return_inverse=True)
    points, cells = points[used.astype(int) - 1], cells.reshape(-1, 3)
    a, b, c = (points[cells[:, k]] for k in range(3))
    is_turned = np.cross(b - a, c - a) < 0
    cells[is_turned] = cells[is_turned][:, ::-1]
    return points, cells


MESHES = {  # edges of the committed mesh, and how one of others is made
    "block": (1, lambda h: rectangle(40, 4, h)),
    "bushing": (2, lambda h: annulus(10, 20, h)),
    "bushing_section": (2, lambda h: mapped(lambda s: [10, -30] + s * [10, 60], 10, 60, h)),
    "cord": (0.3, lambda h: half_disc(CORD / 2, h)),
    "leg": (0.4, lambda h: mapped(leg, 2.235, 9, h)),
    "boot": (0.8, lambda h: mapped(boot, 1.4, 90, h)),
    "boot_sector": (1.6, lambda h: sector(boot, round(90 / h))),
    "lip": (0.5, lambda h: polygon(LIP, h)),
}
LINES = {  # obstacles
    "wall": [(2.4, -0.5), (2.4, 2)],
    "lid": [(-3, 1.77), (2.39, 1.77)],
    "shaft": [(24.3, -6), (24.3, 10)],
}


@dataclasses.dataclass
class Part:
    mesh: str
    more: dict  # of the body's geometry
    scene: dict
    obstacles: tuple = ()

    def content(self):
        geometry = [{"mesh": f"{self.mesh}.msh", "volume_selection": 1, **self.more}]
        geometry += [{"mesh": f"{name}.obj", "is_obstacle": True, "name": name} for name in self.obstacles]
        return {"units": {"length": "mm", "mass": "t", "time": "s"}, "geometry": geometry, **self.scene}


def held(k, *value):
    return {"id": k, "value": list(value)}


def quasistatic(steps, tend=1):
    return {"dt": tend / steps, "tend": tend, "quasistatic": True}


def selected(*rules):
    return {"surface_selection": [{"id": k + 1, **rule} for k, rule in enumerate(rules)]}


def mirror_normal():
    return np.array([-np.sin(SECTOR), np.cos(SECTOR), 0])


def mirror_stiffness(stiffness):
    """By area, across the plane; hardly any along it."""
    n = mirror_normal()
    return stiffness * np.outer(n, n) + 1e-9 * np.eye(3)


CIRCLES = selected(*({"center": [0, 0], "radius": r} for r in (15, 21)))  # 1 the pin's, 2 the sleeve's
PLANE_BUSHING = {**BUSHING, "plane_strain": True}


def bushing(move, steps):
    return Part("bushing", CIRCLES, {
        "materials": PLANE_BUSHING,
        "boundary_conditions": {"dirichlet_boundary": [held(1, *move), held(2, 0, 0)]},
        "time": quasistatic(steps),
        "output": {"forces": [{"name": "pin", "surfaces": 1}]},
    })


def seal(law):
    return Part("leg", selected({"box": [[0, -1], [10, 1e-3]]}, {"box": [[0, 8.999], [10, 10]]}), {
        "materials": law,
        "contact": {"enabled": True},
        "boundary_conditions": {"dirichlet_boundary": [held(1, 0, 0), held(2, 0, "-2.2 * t")]},
        "time": quasistatic(22),
        "output": {"forces": [{"name": "top", "surfaces": 2}]},
    })


PARTS = {
    "shear": Part("block", selected({"box": [[-21, -3], [21, -1.999]]}, {"box": [[-21, 1.999], [21, 3]]}), {
        "materials": YEOH,
        "boundary_conditions": {"dirichlet_boundary": [held(1, 0, 0), held(2, "4 * t", 0)]},
        "time": quasistatic(4),
        "output": {"forces": [{"name": "plate", "surfaces": 2}]},
    }),
    "bushing_radial": bushing(("3 * t", 0), 10),
    "bushing_torsion": bushing(("x * (cos(pi / 4 * t) - 1) - y * sin(pi / 4 * t)",
                                "x * sin(pi / 4 * t) + y * (cos(pi / 4 * t) - 1)"), 5),
    "bushing_axial": Part("bushing_section", selected({"box": [[9, -31], [10.001, 31]]}, {"box": [[19.999, -31], [21, 31]]}), {
        "axisymmetric": True,
        "materials": BUSHING,
        "boundary_conditions": {"dirichlet_boundary": [held(1, 0, "5 * t"), held(2, 0, 0)]},
        "time": quasistatic(5),
        "output": {"forces": [{"name": "pin", "surfaces": 1}]},
    }),
    # Half of the cord above its middle plane. The lid closes until t = 1. Then the fluid at the left rises to 5 MPa.
    "oring": Part("cord", selected({"box": [[-2, 1e-3], [-0.4, 1.4]]}, {"box": [[-2, -1], [2, 1e-3]]}), {
        "materials": YEOH,
        "contact": {"enabled": True},
        "boundary_conditions": {
            "dirichlet_boundary": [{**held(2, 0, 0), "dimension": [False, True]}],
            "obstacle_displacements": [{"id": "lid", "value": [0, "-0.42 * min(t, 1)"]}],
            "pressure_boundary": [{"id": 1, "value": "5 * max(t - 1, 0)"}],
        },
        "time": quasistatic(20, 2),
        "output": {"forces": [{"name": "lid", "obstacles": "lid"}],
                   "paraview": {"options": {"contact_pressure": True, "hydrostatic_pressure": True}}},
    }, ("wall", "lid")),
    # A fluid of 0.6 MPa comes along the surface of that cord from the left. The lid opens from t = 2 on.
    "oring_leak": Part("cord", {"surface_selection": [
        {"id": "inlet", "box": [[-2, 1e-3], [-1.4, 1]]},
        {"id": "outlet", "box": [[1.4, 1e-3], [2, 1]]},
        {"id": "middle", "box": [[-2, -1], [2, 1e-3]]},
        {"id": "top", "box": [[-2, 1e-3], [2, 2]]},
    ]}, {
        "materials": YEOH,
        "contact": {"enabled": True},
        "boundary_conditions": {
            "dirichlet_boundary": [{**held("middle", 0, 0), "dimension": [False, True]}],
            "obstacle_displacements": [{"id": "lid", "value": [0, "-0.42 * min(t, 1) + max(t - 2, 0)"]}],
            "pressure_boundary": [
                {"id": "inlet", "value": FLUID},
                {"id": "top", "value": FLUID, "penetrates": True, "from": "inlet", "leaks_to": "outlet"},
            ],
        },
        "time": quasistatic(54, 2.7),
        "output": {"forces": [{"name": "lid", "obstacles": "lid"}], "paraview": {"options": {"contact_pressure": True}}},
    }, ("wall", "lid")),
    "seal_ogden": seal(OGDEN),
    "seal_yeoh": seal(YEOH),
    "boot": Part("boot", selected({"box": [[0, -1], [40, 1e-3]]}, {"box": [[0, 59.999], [40, 61]]}), {
        "axisymmetric": True,
        "materials": OGDEN,
        "contact": {"enabled": True},
        "boundary_conditions": {"dirichlet_boundary": [held(1, 0, "25 * t"), held(2, 0, 0)]},
        "time": quasistatic(10),
        "output": {"forces": [{"name": "shaft", "surfaces": 1}]},
    }),
    # A 24th of it in space. Springs that resist motion across a plane make this a mirror, as the held side y = 0 is one.
    "boot_sector": Part("boot_sector", selected(
        {"box": [[0, 0, -1], [40, 40, 1e-3]]}, {"box": [[0, 0, 59.999], [40, 40, 61]]}, {"box": [[0, -1, 0], [40, 1e-3, 60]]},
        {"normal": mirror_normal().tolist(), "point": [0, 0, 0]}), {
        "materials": {**OGDEN, "volume": "patches"},
        "space": {"discr_order": 2},
        "contact": {"enabled": True},
        "boundary_conditions": {"dirichlet_boundary": [held(1, 0, 0, "25 * t"), held(2, 0, 0, 0),
                                                       {**held(3, 0, 0, 0), "dimension": [False, True, False]}]},
        "springs": [{"id": 4, "stiffness_by_area": mirror_stiffness(3000).tolist()}],
        "time": quasistatic(10),
        "output": {"forces": [{"name": "shaft", "surfaces": 1}]},
    }),
    # The shaft grows from 24.3 to 25 mm in radius, past the edge of the lip at 24.4 mm.
    "lip_seal": Part("lip", selected({"box": [[31.999, 0], [33, 10]]}), {
        "axisymmetric": True,
        "materials": YEOH,
        "contact": {"enabled": True},
        "boundary_conditions": {
            "dirichlet_boundary": [held(1, 0, 0)],
            "obstacle_displacements": [{"id": "shaft", "value": ["0.7 * t", 0]}],
        },
        "time": quasistatic(10),
        "output": {"forces": [{"name": "shaft", "obstacles": "shaft"}], "paraview": {"options": {"contact_pressure": True}}},
    }, ("shaft",)),
}


def write(folder, names, refine=0):
    folder.mkdir(parents=True, exist_ok=True)
    parts = [PARTS[name] for name in names]
    for mesh in {part.mesh: None for part in parts}:
        h, make = MESHES[mesh]
        write_msh(folder / f"{mesh}.msh", *make(h / 2**refine))
    for line in {name: None for part in parts for name in part.obstacles}:
        write_obj(folder / f"{line}.obj", LINES[line], lines=[(k, k + 1) for k in range(len(LINES[line]) - 1)])
    for name, part in zip(names, parts):
        (folder / f"{name}.json").write_text(json.dumps(part.content(), indent=2) + "\n")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scenes", nargs="*", metavar="SCENE", help=f"of {', '.join(PARTS)}; default: all")
    parser.add_argument("-o", "--output", type=pathlib.Path, default=HERE)
    parser.add_argument("--refine", type=int, default=0, metavar="K")
    options = parser.parse_args()
    write(options.output, options.scenes or list(PARTS), options.refine)


if __name__ == "__main__":
    main()
