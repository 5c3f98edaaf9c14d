#!/usr/bin/python3
# SPDX-License-Identifier: MIT
"""Writes the scenes of the hard-contact set with their meshes into a folder.

python3 verification/hard_contact/make.py FOLDER [--scene PART-OF-NAME]... [--list]

Each scene gets a folder: scene.json (what happens, in plain terms), mesh.npz, body*.msh and obstacle*.obj (its meshes, for any
code), itr.json (the scene as ITR reads it) and scenario.json (others' format). README.md describes them. ITR is not needed.
"""
import argparse
import dataclasses
import json
import math
import pathlib
import sys

import numpy as np

HERE = pathlib.Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent), str(HERE.parent / "stability"), str(HERE.parent / "newton")]
import bodies  # noqa: E402
import hard_cases  # noqa: E402
import own_scenes  # noqa: E402
from score import boundary  # noqa: E402

# Kinds of `stability` by the beginning of their names, for the table.
KINDS = {"nu_": "strain", "needles": "strain", "compressed": "strain", "twist": "strain", "storm": "remeshing", "scale_": "scale",
         "exact_": "scale", "far_": "scale", "impact": "speed", "dt_": "speed", "points": "thin obstacle", "wires": "thin obstacle",
         "sheet": "thin obstacle", "sharp": "sharp", "slivers": "mesh", "stiff_": "ratio", "soft_": "ratio", "heavy_": "ratio"}
# Smallest volumes by those at rest in results of the stability set that depend on mesh and law alone (no contact, one solution).
VOLUME_RATIOS = ("nu_0_49", "nu_0_499", "nu_0_4999", "nu_0_49_3d", "nu_0_4999_3d")
LONG = ("squishy_balls_fine",)  # over 60 s


@dataclasses.dataclass
class Scene(hard_cases.Scene):
    """A scene of the stability set that remembers its meshes, and what it can be held against."""
    meshes: list = dataclasses.field(default_factory=list)
    obstacle_meshes: list = dataclasses.field(default_factory=list)
    references: list = dataclasses.field(default_factory=list)
    from_user: bool = False  # solved with the tolerances that users have, not to round-off

    def body(self, points, cells, **material):
        moved = np.array(points, dtype=float) * self.size
        moved[:, 0] += self.origin
        self.meshes.append((moved, np.asarray(cells)))
        return super().body(points, cells, **material)

    def obstacle(self, points, edges=(), faces=(), move=None):
        moved = np.array(points, dtype=float) * self.size
        moved[:, 0] += self.origin
        self.obstacle_meshes.append((moved, np.reshape(edges, (-1, 2)).astype(int), np.reshape(faces, (-1, 3)).astype(int)))
        super().obstacle(points, edges, faces, move)

    def reference(self, of, value, bar, source, at=None, **what):
        """A value with its bar, which is relative, at a time (by default the end)."""
        self.references.append({"of": of, "at": self.dt * self.steps if at is None else at, "value": float(value),
                                "bar": abs(float(bar * value)), "source": source, **what})

    def side(self, number, side):
        """Numbers of a body's nodes on a side of its bounding box: those of surface facets that lie in it, as ITR chooses them."""
        points, cells = self.meshes[number - 1]
        axis, is_high = {1: (0, False), 2: (1, False), 3: (0, True), 4: (1, True), 5: (2, False), 6: (2, True)}[side]
        plane = points[:, axis].max() if is_high else points[:, axis].min()
        facets = boundary(cells)
        flat = (np.abs(points[facets][:, :, axis] - plane) <= 1e-6 * self.size).all(axis=1)
        return np.unique(facets[flat])


def words_of(function):
    """Docstring of a case, or of the function that a variant of it calls."""
    inner = [cell.cell_contents for cell in function.__closure__ or () if callable(cell.cell_contents)]
    return next((f.__doc__ for f in (function, *inner) if f.__doc__), None)


def from_stability(name):
    def fill(scene):
        hard_cases.CASES[name](scene)
        if name in VOLUME_RATIOS:
            import table
            rows = {row.case: row for row in table.read(HERE.parent / "stability/results.csv")}
            scene.reference("volume ratio", rows[name].worst_volume, 0.01, "verification/stability/results.csv: same mesh and law")
    fill.__doc__ = words_of(hard_cases.CASES[name]) or name.replace("_", " ")
    kind = next((kind for start, kind in KINDS.items() if name.startswith(start)), "gap" if "gap" in name else "touching")
    return fill, kind


def from_squeeze(name):
    fill, dim, *_ = bodies.BODIES[name]

    def filled(scene):
        scene.dim, scene.from_user = dim, True
        fill(scene)
    filled.__doc__ = fill.__doc__
    return filled, "squeeze"


def all_scenes():
    """{name: (function that fills a Scene, kind)}; quadratic variants are left out, since the mesh's order is free here."""
    scenes = {name: from_stability(name) for name in hard_cases.CASES}
    scenes |= {"squeeze_" + name.replace(" ", "_"): from_squeeze(name) for name in bodies.BODIES if "quadratic" not in name}
    return scenes | own_scenes.SCENES


def lame(material, dim):
    """mu and lambda [Pa] of the law; 2D is plane stress unless the material says plane strain."""
    E, nu = material["E"], material["nu"]
    plane_stress = dim == 2 and not material.get("plane_strain")
    return E / (2 * (1 + nu)), E * nu / (1 - nu**2) if plane_stress else E * nu / ((1 + nu) * (1 - 2 * nu))


def acts_across_only(scene, points, axis):
    """Whether an obstacle can push along one other axis alone: it is flat across that one, and no body comes near its rim."""
    whole = np.concatenate([mesh for mesh, _ in scene.meshes])
    low, high = whole.min(axis=0), whole.max(axis=0)
    reach = (high - low).max()
    covers = (points.min(axis=0) <= low - reach) & (points.max(axis=0) >= high + reach)
    flat = np.ptp(points, axis=0) == 0
    return any(flat[b] and all(covers[c] for c in range(scene.dim) if c != b) for b in range(scene.dim) if b != axis)


def momentum_axes(scene):
    """Axes along which nothing acts but weight."""
    held = [axis for axis in range(scene.dim) if any((row.get("dimension") or [True] * scene.dim)[axis] for row in scene.held)]
    pushed = [axis for axis in range(scene.dim) if any(
        scene.friction or not acts_across_only(scene, points, axis) for points, *_ in scene.obstacle_meshes)]
    return [axis for axis in range(scene.dim) if axis not in held and axis not in pushed]


def described(name, kind, what, scene):
    """scene.json."""
    offsets = np.cumsum([0] + [len(points) for points, _ in scene.meshes])
    velocity = {row["id"]: row["value"] for row in scene.velocity}
    of_obstacle = {row["id"] - 1000: row["value"] for row in scene.moved}
    held = []
    for row in scene.held:
        number, side = divmod(row["id"], 10)
        which = row.get("dimension") or [True] * scene.dim
        held.append({"body": number, "side": side, "nodes": (scene.side(number, side) + offsets[number - 1]).tolist(),
                     "displacement": [value if fixed else None for value, fixed in zip(row["value"], which)]})
    materials = [material for _, material in scene.bodies]
    return {
        "name": name, "kind": kind, "what": what, "dim": scene.dim, "units": "m, kg, s",
        "bodies": [{"mesh": f"body{k}.msh", "law": "NeoHookean", **dict(zip(("mu", "lambda"), lame(m, scene.dim))), "rho": m["rho"],
                    "velocity": velocity.get(k, [0.0] * scene.dim)} for k, m in enumerate(materials, 1)],
        "obstacles": [{"mesh": f"obstacle{k}.obj", "displacement": of_obstacle.get(k)} for k in range(1, len(scene.obstacles) + 1)],
        "held": held, "gravity": [0.0, -scene.gravity, 0.0][:scene.dim],
        "contact": scene.contact, "friction": scene.friction,
        "time": {"dt": scene.dt, "end": scene.dt * scene.steps, "quasistatic": scene.quasistatic},
        "mesh_may_change": scene.remesh is not None, "driven": bool(scene.driven), "momentum_axes": momentum_axes(scene),
        "asked": "x and v of all nodes at each multiple of dt", "references": scene.references, "long": name in LONG}


def scenario(about):
    """The scene by the keys that docs/harness.md of mesh-elasticity-solver-benchmark lists for scenarios."""
    return {"mesh": "mesh.npz", "boundary_conditions": {"held": about["held"], "obstacles": about["obstacles"]},
            "energy_params": [{key: body[key] for key in ("law", "mu", "lambda", "rho")} for body in about["bodies"]],
            "initial_state": {"velocity": [body["velocity"] for body in about["bodies"]]},
            "target_tolerance": None, "budget": None, "load_schedule": "stepping" if about["driven"] else "none",
            "contact": {"barrier_dhat": None, "ccd_tolerance": None, "friction": about["friction"], "friction_eps_v": None,
                        "time_step": about["time"]["dt"]} if about["contact"] else "none", "element": "P1"}


def for_itr(scene):
    """itr.json: paths relative to it, PolyFEM's set of defaults as in the sets that scenes come from."""
    content = {"defaults": "polyfem", **scene.content()}
    for geometry in content["geometry"]:
        geometry["mesh"] = pathlib.Path(geometry["mesh"]).name
    content["output"]["forces"] = [{"name": f"obstacle{k}", "obstacles": 1000 + k} for k in range(1, len(scene.obstacles) + 1)]
    if scene.remesh is not None:  # the set has linear elements
        content["space"]["remesh"]["curve"] = {"enabled": False}
    if scene.from_user:
        content["solver"]["nonlinear"] = {"x_delta": 1e-3, "grad_norm": 1e-8, "max_iterations": 3000}
    return content


def write_mesh(path, scene):
    """mesh.npz: all bodies in one mesh, all obstacles in another."""
    offsets = np.cumsum([0] + [len(points) for points, _ in scene.meshes])
    starts = np.cumsum([0] + [len(points) for points, *_ in scene.obstacle_meshes])
    stack = lambda rows, width: np.concatenate([*rows, np.empty((0, width))])  # noqa: E731
    np.savez(path, points=np.concatenate([points for points, _ in scene.meshes]),
             simplices=np.concatenate([cells + first for (_, cells), first in zip(scene.meshes, offsets)]),
             body=np.concatenate([np.full(len(cells), k) for k, (_, cells) in enumerate(scene.meshes, 1)]),
             obstacle_points=stack([points for points, *_ in scene.obstacle_meshes], scene.dim),
             obstacle_edges=stack([e + first for (_, e, _), first in zip(scene.obstacle_meshes, starts)], 2).astype(int),
             obstacle_faces=stack([f + first for (*_, f), first in zip(scene.obstacle_meshes, starts)], 3).astype(int),
             obstacle_of_point=np.repeat(np.arange(1, len(scene.obstacle_meshes) + 1), np.diff(starts)))


def write(name, folder):
    """Returns what scene.json has."""
    fill, kind = all_scenes()[name]
    folder = pathlib.Path(folder) / name
    folder.mkdir(parents=True, exist_ok=True)
    scene = Scene(folder)
    fill(scene)
    about = described(name, kind, " ".join((fill.__doc__ or "").split()), scene)
    write_mesh(folder / "mesh.npz", scene)
    for file, content in (("scene.json", about), ("itr.json", for_itr(scene)), ("scenario.json", scenario(about))):
        (folder / file).write_text(json.dumps(content, indent=1) + "\n")
    return about


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--scene", action="append")
    parser.add_argument("--list", action="store_true", help="names only")
    options = parser.parse_args()
    names = [name for name in all_scenes() if not options.scene or any(part in name for part in options.scene)]
    for name in names:
        if options.list:
            print(name)
            continue
        about = write(name, options.folder)
        print(f"{name}: {about['kind']}, {about['dim']}D, {math.ceil(about['time']['end'] / about['time']['dt'] - 1e-9)} steps")


if __name__ == "__main__":
    main()
