#!/usr/bin/python3
# SPDX-License-Identifier: MIT
"""Makes the scenes of assemblies and their meshes: press fits, a shrink fit, a snap hook, a gripper finger, a rubber mount and a
part that lies down. A level halves all cells.

usage: make.py [-o DIR] [--level N] [SCENE...]
"""
import argparse
import json
import math
import pathlib
import sys

import numpy as np

HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent))
from make_meshes import boxes, write_msh, write_obj  # noqa: E402

UNITS = {"length": "mm", "mass": "t", "time": "s"}  # forces are in N, stresses in MPa
GRAVITY = 9810
STEEL = {"type": "LinearElasticity", "E": 200e3, "nu": 0.3, "rho": 7.85e-9}
ALUMINIUM = {"type": "LinearElasticity", "E": 70e3, "nu": 0.33, "rho": 2.7e-9}
POM = {"type": "NeoHookean", "E": 2800, "nu": 0.38, "rho": 1.41e-9, "plane_strain": True}
SILICONE = {"type": "NeoHookean", "E": 1, "nu": 0.45, "rho": 1.1e-9, "plane_strain": True}
RUBBER = {"type": "NeoHookean", "E": 3, "nu": 0.49, "rho": 1.1e-9}
STRIP = {"type": "NeoHookean", "E": 40, "nu": 0.4, "rho": 1.1e-9}
STRIP_HEIGHT, SUPPORT, END = 3.0, 30.0, 50.0
BORE, FIT, RIM = 20.0, 40.0, 60.0  # radii of two rings
OVERLAP = 0.02


def grid(xs, ys, keep=None, place=None):
    """Triangles of a grid of lines, with diagonals that alternate. keep(x, y) tells of the middle of a quadrilateral whether it is
    there, place(x, y) moves vertices."""
    points = np.array([(x, y) for x in xs for y in ys], dtype=float)
    number = np.arange(len(points)).reshape(len(xs), len(ys))
    cells = []
    for i in range(len(xs) - 1):
        for j in range(len(ys) - 1):
            if keep and not keep((xs[i] + xs[i + 1]) / 2, (ys[j] + ys[j + 1]) / 2):
                continue
            a, b, c, d = number[i, j], number[i + 1, j], number[i + 1, j + 1], number[i, j + 1]
            cells += [(a, b, c), (a, c, d)] if (i + j) % 2 else [(a, b, d), (b, c, d)]
    used, cells = np.unique(cells, return_inverse=True)
    points = points[used]
    return np.array([place(*p) for p in points]) if place else points, cells.reshape(-1, 3)


def span(low, high, count):
    return np.linspace(low, high, count + 1)


def graded(low, high, first, last):
    """Places between two ends; cells grow from about `first` at `low` to `last` at `high`."""
    count = max(1, round((high - low) / (last - first) * math.log(last / first))) if last != first else round((high - low) / first)
    steps = first * (last / first) ** ((np.arange(count) + 0.5) / count)
    return low + (high - low) * np.concatenate([[0], np.cumsum(steps)]) / steps.sum()


def quarter(radii, around):
    """A quarter of a ring; vertices on the axes lie on them exactly."""
    def place(r, part):
        return (0 if part == around else r * math.cos(math.pi / 2 * part / around),
                0 if part == 0 else r * math.sin(math.pi / 2 * part / around))

    return grid(radii, np.arange(around + 1), place=place)


def quarter_3d(radii, around, height, layers):
    """A quarter of a ring with a height along z."""
    points, cells = boxes((len(radii) - 1, around, layers), (len(radii) - 1, around, layers))
    points = np.round(points + np.array([len(radii) - 1, around, layers]) / 2).astype(int)
    angle = math.pi / 2 * points[:, 1] / around
    r = np.asarray(radii)[points[:, 0]]
    x, y = np.where(points[:, 1] == around, 0, r * np.cos(angle)), np.where(points[:, 1] == 0, 0, r * np.sin(angle))
    return np.stack([x, y, height * points[:, 2] / layers], axis=1), cells


SIDES = {"threshold": 1e-6}  # of a mesh's box: 1 left, 2 bottom, 3 right, 4 top


def roller(side, axis, dim=2):
    return {"id": side, "value": [0] * dim, "dimension": [k == axis for k in range(dim)]}


def beyond(number, axis, position):
    """Names facets beyond a place on an axis."""
    return {"id": number, "axis": axis, "position": position}


def body(mesh, number, surfaces=None, **more):
    return {"mesh": f"meshes/{mesh}.msh", "volume_selection": number, "surface_selection": surfaces or SIDES} | more


def facets(radius):
    """Cells around a quarter whose chords sag by 0.9 % of the overlap."""
    return math.ceil(math.pi / 2 * radius / math.sqrt(8 * radius * 0.009 * OVERLAP))


def fit_radii(cell, coarse):
    """Radii of the inner and of the outer ring; cells are small where they meet."""
    inner = FIT + OVERLAP / 2 - graded(0, FIT + OVERLAP / 2 - BORE, cell, coarse)[::-1]
    return inner, FIT - OVERLAP / 2 + graded(0, RIM - FIT + OVERLAP / 2, cell, coarse)


def press_fit(refine, outside=0, name="press_fit"):
    """A quarter of two rings in plane stress; vertices of the bore are by a part of its facets' sag outside of it."""
    around = facets(FIT) * refine
    inner, outer = fit_radii(FIT * math.pi / 2 / around, 2 / refine)
    outer[0] += outside * outer[0] * (1 - math.cos(math.pi / 4 / (around + 13)))
    meshes = {f"{name}_hub": quarter(inner, around), f"{name}_ring": quarter(outer, around + 13)}
    scene = {"units": UNITS,
             "geometry": [body(f"{name}_hub", 1), body(f"{name}_ring", 2)],
             "materials": [{"id": 1} | STEEL, {"id": 2} | ALUMINIUM],
             "boundary_conditions": {"dirichlet_boundary": [roller(1, 0), roller(2, 1)]},
             "contact": {"enabled": True, "initial_overlap": "resolve"},
             "output": {"forces": [{"name": "hub", "bodies": 1}], "paraview": {"options": {"contact_pressure": True}}}}
    return meshes, scene


def press_fit_moved(refine):
    """A press fit whose bore has the right radius in the mean."""
    return press_fit(refine, 2 / 3, "press_fit_moved")


def press_fit_axisymmetric(refine):
    """The section of the rings, whose rounds are exact."""
    n = 8 * refine
    inner, outer = span(BORE, FIT + OVERLAP / 2, n), span(FIT - OVERLAP / 2, RIM, n + 1)
    meshes = {"section_hub": grid(inner, span(0, 10, n // 2)), "section_ring": grid(outer, span(0, 10, n // 2 + 1))}
    scene = {"axisymmetric": True, "units": UNITS,
             "geometry": [body("section_hub", 1), body("section_ring", 2)],
             "materials": [{"id": 1} | STEEL, {"id": 2} | ALUMINIUM],
             "boundary_conditions": {"dirichlet_boundary": [roller(2, 1)]},
             "contact": {"enabled": True, "initial_overlap": "resolve"},
             "output": {"forces": [{"name": "hub", "bodies": 1}], "paraview": {"options": {"contact_pressure": True}}}}
    return meshes, scene


def press_fit_3d(refine):
    """A quarter of the rings as solids, a slice between a roller plane and a free side."""
    around = facets(FIT) * refine
    inner, outer = fit_radii(0.5 / refine, 2 / refine)
    outer[0] += 2 / 3 * outer[0] * (1 - math.cos(math.pi / 4 / (around + 13)))
    meshes = {"solid_hub": quarter_3d(inner, around, 0.5, refine), "solid_ring": quarter_3d(outer, around + 13, 0.5, refine)}
    scene = {"units": UNITS,
             "geometry": [body("solid_hub", 1), body("solid_ring", 2)],
             "materials": [{"id": 1} | STEEL, {"id": 2} | ALUMINIUM],
             "boundary_conditions": {"dirichlet_boundary": [roller(1, 0, 3), roller(2, 1, 3), roller(5, 2, 3)]},
             "contact": {"enabled": True, "initial_overlap": "resolve"},
             "output": {"forces": [{"name": "hub", "bodies": 1}], "paraview": {"options": {"contact_pressure": True}}}}
    return meshes, scene


def shrink_fit(refine):
    """A collar with play, cooled onto a hub: the section of both."""
    n, gap = 8 * refine, 0.002
    meshes = {"shrink_hub": grid(span(BORE, FIT, n), span(0, 10, n // 2)),
              "shrink_collar": grid(span(FIT + gap, RIM, n + 1), span(0, 10, n // 2 + 1))}
    cooling = f"-{(OVERLAP + gap) / FIT:g} * t"  # closes the gap and leaves the overlap
    scene = {"axisymmetric": True, "units": UNITS,
             "geometry": [body("shrink_hub", 1), body("shrink_collar", 2)],
             "materials": [{"id": 1} | STEEL, {"id": 2} | ALUMINIUM | {"eigenstrain": cooling}],
             "boundary_conditions": {"dirichlet_boundary": [roller(2, 1)]},
             "time": {"quasistatic": True, "dt": 0.1, "tend": 1},
             "contact": {"enabled": True},
             "output": {"forces": [{"name": "hub", "bodies": 1}], "points": [{"name": "rim", "rest": [RIM, 0]}]}}
    return meshes, scene


def hook_lines(refine):
    """Columns and rows of a hook: a beam, and a nose under its end, that falls to a tenth over the slope."""
    return (np.concatenate([span(0, 20, 20 * refine), span(20, 21, 2 * refine)[1:], span(21, 21 + SLOPE, 4 * refine)[1:]]),
            np.concatenate([span(-NOSE, 0, 2 * refine), span(0, 2, 4 * refine)[1:]]))


def hook_place(x, y):
    return x, y * (1 - 0.96 * max(0, x - 21) / SLOPE) if y < 0 else y


NOSE = 1.5
SLOPE = 0.96 * NOSE / math.tan(math.pi / 6)


def snap_hook(refine):
    """A hook at a carriage that a force pushes, past a catch, until the carriage meets its stop."""
    columns, rows = hook_lines(refine)
    meshes = {"hook": grid(columns, rows, keep=lambda x, y: y > 0 or x > 20, place=hook_place),
              "carriage": grid(span(-4, 0, 3), span(-1, 3, 3))}
    catch = {"catch": [(24, -3), (24, -0.1), (27, -0.1), (27, -3)], "stop": [(7.3, 2.5), (7.3, 4)]}
    scene = {"units": UNITS,
             "geometry": [body("hook", 1, [beyond(4, "-x", 0.01)]),
                          body("carriage", 2, [beyond(5, "x", -0.01)], rigid={"force": ["1.5 * t", 0], "held": ["y", "rz"]})]
             + [{"mesh": f"meshes/{name}.obj", "is_obstacle": True, "name": name} for name in catch],
             "materials": [{"id": 1} | POM],
             "ties": [{"a": 4, "b": 5}],
             "space": {"discr_order": 2},
             "time": {"quasistatic": True, "dt": 0.05, "tend": 1},
             "contact": {"enabled": True, "friction_coefficient": 0.3},
             "output": {"forces": [{"name": name, "obstacles": name} for name in catch],
                        "points": [{"name": "carriage", "rest": [-4, 0]}]}}
    return meshes | catch, scene


def finger_lines(refine):
    """Columns and rows of a finger."""
    columns = [[-4]] + [10 * k + span(low, high, count * refine) for k in range(6)
                        for low, high, count in ((0, 1.5, 2), (1.5, 7.5, 4), (7.5, 9, 2), (9, 10, 1)) if k < 5 or low < 9]
    return np.unique(np.concatenate(columns)), np.unique(np.concatenate([span(0, 2, 2 * refine), span(2, 13, 6 * refine),
                                                                         span(13, 14.5, 2 * refine)]))


def is_finger(x, y):
    """A strip, and six chambers with walls and gaps between them."""
    place = x % 10
    return x < 0 or y < 2 or (place < 9 and (y > 13 or not 1.5 < place < 7.5))


DISC, DISC_RADIUS = (40, -12), 10


def gripper(refine):
    """A finger of six chambers on a stiffer strip, pumped up until it lies on a disc."""
    disc = [(DISC[0] + DISC_RADIUS * math.cos(a), DISC[1] + DISC_RADIUS * math.sin(a)) for a in span(0, 2 * math.pi, 96 * refine)]
    chambers = [{"id": 8, "box": [[10 * k + 1.4, 1.9], [10 * k + 7.6, 13.1]]} for k in range(6)]
    scene = {"units": UNITS,
             "geometry": [body("finger", 1, chambers + [beyond(1, "-x", -3.99)],
                               volume_selection=[beyond(2, "-y", 2), beyond(1, "y", 2)]),
                          {"mesh": "meshes/disc.obj", "is_obstacle": True, "name": "disc"}],
             "materials": [{"id": 1} | SILICONE, {"id": 2} | SILICONE | {"E": 5}],
             "boundary_conditions": {"dirichlet_boundary": [{"id": 1, "value": [0, 0]}],
                                     "pressure_cavity": [{"id": 8, "name": "chambers", "value": "0.1 * t",
                                                          "external_pressure": 0.1013}]},
             "time": {"quasistatic": True, "dt": 0.1, "tend": 1},
             "contact": {"enabled": True},
             "space": {"discr_order": 2},
             "output": {"forces": [{"name": "disc", "obstacles": "disc"}], "points": [{"name": "tip", "rest": [59, 0]}]}}
    return {"finger": grid(*finger_lines(refine), keep=is_finger), "disc": disc}, scene


def rubber_mount(refine):
    """A disc of rubber between two plates of steel, bonded to both and pressed: the section."""
    n = 8 * refine
    meshes = {"mount_foot": grid(span(0, 22, n - 2), span(-3, 0, refine)),
              "mount_rubber": grid(span(0, 20, n), span(0, 15, n * 3 // 4)),
              "mount_top": grid(span(0, 22, n - 1), span(15, 18, refine))}
    scene = {"axisymmetric": True, "units": UNITS,
             "geometry": [body("mount_foot", 1, [beyond(1, "-y", -2.99), beyond(10, "y", -0.01)]),
                          body("mount_rubber", 2, [beyond(11, "-y", 0.01), beyond(12, "y", 14.99)]),
                          body("mount_top", 3, [beyond(13, "-y", 15.01), beyond(4, "y", 17.99)])],
             "materials": [{"id": [1, 3]} | STEEL, {"id": 2} | RUBBER],
             "ties": [{"a": 10, "b": 11}, {"a": 12, "b": 13}],
             "boundary_conditions": {"dirichlet_boundary": [{"id": 1, "value": [0, 0]}],
                                     "neumann_boundary": [{"id": 4, "value": [0, f"-{500 / (math.pi * 22**2):.6g} * t"]}]},
             "space": {"discr_order": 2},
             "time": {"quasistatic": True, "dt": 0.25, "tend": 1},
             "output": {"forces": [{"name": "foot", "surfaces": 1}], "points": [{"name": "top", "rest": [0, 18]}]}}
    return meshes, scene


def laid_down(refine):
    """A strip of soft plastic falls onto two knife edges, by its weight."""
    scene = {"units": UNITS,
             "geometry": [body("strip", 1, transformation={"translation": [0, 1]})]
             + [{"mesh": "meshes/edge.obj", "is_obstacle": True, "name": name, "transformation": {"translation": [x, 0]}}
                for name, x in (("left", -SUPPORT), ("right", SUPPORT))],
             "materials": [{"id": 1} | STRIP],
             "boundary_conditions": {"rhs": [0, GRAVITY]},
             "contact": {"enabled": True},
             "space": {"discr_order": 2},
             "output": {"forces": [{"name": name, "obstacles": name} for name in ("left", "right")],
                        "points": [{"name": name, "rest": [x, 1 + STRIP_HEIGHT / 2]}
                                   for name, x in (("middle", 0), ("end", END), ("above", SUPPORT))]}}
    return {"strip": grid(span(-END, END, 40 * refine), span(0, STRIP_HEIGHT, 2 * refine)),
            "edge": [(-3, -5), (0, 0), (3, -5)]}, scene


SCENES = {f.__name__: f for f in (press_fit, press_fit_moved, press_fit_axisymmetric, press_fit_3d, shrink_fit, snap_hook,
                                  gripper, rubber_mount,
                                  laid_down)}


def make(folder, names=SCENES, level=0):
    """Writes scenes and meshes of a level into a folder."""
    (folder / "meshes").mkdir(parents=True, exist_ok=True)
    for name in names:
        meshes, scene = SCENES[name](2**level)
        for mesh, parts in meshes.items():
            if isinstance(parts, list):
                write_obj(folder / "meshes" / f"{mesh}.obj", parts, lines=[(k, k + 1) for k in range(len(parts) - 1)])
            else:
                write_msh(folder / "meshes" / f"{mesh}.msh", *parts)
        (folder / f"{name}.json").write_text(json.dumps(scene, indent=2) + "\n")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("-o", "--output", type=pathlib.Path, default=HERE)
    parser.add_argument("--level", type=int, default=0)
    parser.add_argument("scenes", nargs="*", default=list(SCENES), metavar="SCENE", help=", ".join(SCENES))
    options = parser.parse_args()
    unknown = set(options.scenes) - set(SCENES)
    if unknown:
        parser.error(f"no scene {sorted(unknown)[0]}; there are {', '.join(SCENES)}")
    make(options.output, options.scenes, options.level)


if __name__ == "__main__":
    main()
