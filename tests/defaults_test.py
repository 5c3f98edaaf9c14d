# SPDX-License-Identifier: MIT
"""Numbers that scenes get which set no key of method: forces, slip and speed are right by defaults; what runs report.

python3 tests/defaults_test.py ITR SOURCE_FOLDER [NAME...]
"""
import csv
import itertools
import json
import math
import pathlib
import subprocess
import sys
import tempfile
import unittest

import h5py

ITR = SOURCE = None


def rectangle(path, width, height, columns, rows, place=lambda x, y: (x, y)):
    """Triangles on a grid with its lower left corner at the origin, moved by `place`."""
    lines = [f"v {x!r} {y!r} 0" for x, y in (place(width * i / columns, height * j / rows)
                                             for j in range(rows + 1) for i in range(columns + 1))]
    for j in range(rows):
        for i in range(columns):
            a = j * (columns + 1) + i + 1
            b, c, d = a + 1, a + columns + 2, a + columns + 1
            lines += ([f"f {a} {b} {c}", f"f {a} {c} {d}"] if (i + j) % 2 else [f"f {a} {b} {d}", f"f {b} {c} {d}"])
    path.write_text("\n".join(lines) + "\n")


def disc(path, radius, rings, sectors):
    """Rings of `sectors` vertices around the centre."""
    lines = ["v 0 0 0"]
    for ring in range(1, rings + 1):
        for k in range(sectors):
            angle = 2 * math.pi * k / sectors
            lines.append(f"v {radius * ring / rings * math.cos(angle)!r} {radius * ring / rings * math.sin(angle)!r} 0")
    for k in range(sectors):
        lines.append(f"f 1 {2 + k} {2 + (k + 1) % sectors}")
    for ring in range(1, rings):
        for k in range(sectors):
            a, b = 2 + (ring - 1) * sectors + k, 2 + (ring - 1) * sectors + (k + 1) % sectors
            lines += [f"f {a} {a + sectors} {b + sectors}", f"f {a} {b + sectors} {b}"]
    path.write_text("\n".join(lines) + "\n")


def box(path, size, counts):
    """Six tetrahedra in each brick of a grid with its lowest corner at the origin."""
    nx, ny, nz = counts
    number = lambda i, j, k: 1 + i + (nx + 1) * (j + (ny + 1) * k)
    points = [(size[0] * i / nx, size[1] * j / ny, size[2] * k / nz)
              for k in range(nz + 1) for j in range(ny + 1) for i in range(nx + 1)]
    cells = []
    for i, j, k in itertools.product(range(nx), range(ny), range(nz)):
        for axes in itertools.permutations(range(3)):
            corner, corners = [i, j, k], [number(i, j, k)]
            for axis in axes:
                corner[axis] += 1
                corners.append(number(*corner))
            is_even = (axes.index(0) > axes.index(1)) + (axes.index(0) > axes.index(2)) + (axes.index(1) > axes.index(2))
            cells.append(corners if is_even % 2 == 0 else [corners[0], corners[2], corners[1], corners[3]])
    lines = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat", "$Nodes", len(points)]
    lines += [f"{n} {x!r} {y!r} {z!r}" for n, (x, y, z) in enumerate(points, 1)]
    lines += ["$EndNodes", "$Elements", len(cells)]
    lines += [f"{n} 4 2 1 1 {' '.join(map(str, cell))}" for n, cell in enumerate(cells, 1)] + ["$EndElements"]
    path.write_text("\n".join(map(str, lines)) + "\n")


def merged(scene, changes):
    """RFC 7396."""
    result = dict(scene)
    for key, value in changes.items():
        result[key] = merged(result.get(key, {}), value) if isinstance(value, dict) else value
    return result


class Case(unittest.TestCase):
    def setUp(self):
        self.scratch = tempfile.TemporaryDirectory()
        self.folder = pathlib.Path(self.scratch.name)

    def tearDown(self):
        self.scratch.cleanup()

    def call(self, *arguments, status=0):
        done = subprocess.run([ITR, *map(str, arguments)], capture_output=True, text=True)
        self.assertEqual(done.returncode, status, done.stderr)
        return done.stdout + done.stderr

    def write(self, scene):
        path = self.folder / "scene.json"
        path.write_text(json.dumps(scene))
        return path

    def run_scene(self, scene, *arguments):
        """Words of a run into out/."""
        return self.call("run", self.write(scene), "-o", self.folder / "out", "--overwrite", "--threads", 1, *arguments)

    def forces(self, scene, *arguments):
        """Rows of forces.csv by step; the run's words are kept."""
        self.words = self.run_scene(scene, *arguments)
        with open(self.folder / "out/forces.csv") as file:
            return [{key: value if key == "name" else float(value) for key, value in row.items()} for row in csv.DictReader(file)]


class Sets(Case):
    """Which set a scene gets, and who says so."""

    def square(self, **more):
        rectangle(self.folder / "square.obj", 0.1, 0.1, 2, 2)
        return {"geometry": [{"mesh": "square.obj", "volume_selection": 1},
                             {"type": "ground", "height": -0.01, "is_obstacle": True}],
                "materials": {"type": "NeoHookean", "E": 1e5, "nu": 0.3, "rho": 1000},
                "boundary_conditions": {"rhs": [0, 9.81]}, "time": {"dt": 0.01, "time_steps": 4},
                "contact": {"enabled": True, "friction_coefficient": 0.2}, **more}

    def name(self):
        return json.loads((self.folder / "out/summary.json").read_text())["defaults"]

    def test_a_scene_that_says_nothing_gets_those_of_itr(self):
        words = self.run_scene(self.square())
        self.assertEqual(self.name(), "itr-1")
        self.assertNotIn("polyfem", words)

    def test_the_scene_or_the_command_chooses(self):
        self.run_scene(self.square(defaults="polyfem"))
        self.assertEqual(self.name(), "polyfem-1")
        self.run_scene(self.square(), "--defaults", "polyfem")
        self.assertEqual(self.name(), "polyfem-1")
        self.run_scene(self.square(defaults="polyfem"), "--defaults", "itr")
        self.assertEqual(self.name(), "itr-1")
        words = self.call("run", self.write(self.square(defaults="abaqus")), status=2)
        self.assertIn("/defaults", words)

    def test_a_run_that_goes_on_keeps_its_set(self):
        scene = self.write(self.square(output={"checkpoint_period": 0}))
        begin = ["run", scene, "-o", self.folder / "out", "--threads", 1]
        self.call(*begin, "--set", "/time/time_steps=2", "--defaults", "polyfem")
        self.assertIn("defaults: polyfem-1", self.call(*begin, "--resume"))
        self.assertEqual(self.name(), "polyfem-1")
        self.assertIn("/defaults: was", self.call(*begin, "--resume", "--defaults", "itr", status=2))

    def test_explain_prints_value_and_reason_of_each(self):
        words = self.call("explain", self.write(self.square()))
        listed = words[words.index("\ndefaults\n"):].splitlines()[2:]
        rows = [line.strip() for line in listed[1:listed.index("warnings")]]
        page = (pathlib.Path(SOURCE) / "docs/scenes.md").read_text()
        self.assertTrue(rows)
        for row in rows:
            pointer, rest = row.split(" = ", 1)
            value, reason = rest.split(": ", 1)
            self.assertIn(f"| `{pointer}` | `{value}` |", page)
            self.assertIn(reason, page)
        self.assertIn("linf_grad", self.call("explain", self.write(self.square(defaults="polyfem"))))

    def test_a_key_that_the_scene_has_is_no_default(self):
        words = self.call("explain", self.write(self.square(time={"dt": 0.01, "time_steps": 4, "integrator": "BDF3"})))
        self.assertNotIn("/time/integrator", words[words.index("\ndefaults\n"):])

    def test_keys_of_polyfem_without_a_choice_get_one_line(self):
        peers = {"solver": {"augmented_lagrangian": {"initial_weight": 1e6}}}
        words = self.run_scene(self.square(**peers))
        self.assertEqual(words.count("--defaults polyfem"), 1)
        self.assertIn("/solver/augmented_lagrangian/initial_weight", words)
        self.assertNotIn("--defaults polyfem", self.run_scene(self.square(defaults="itr", **peers)))


class Cost(Case):
    """Newton iterations of ITR's set by those of PolyFEM's, of which friction is of the step before and creeps."""

    def iterations(self, task, *arguments):
        self.call("run", pathlib.Path(SOURCE) / "examples/tasks" / task, "-o", self.folder / "out", "--overwrite", "--threads", 1,
                  *arguments)
        lines = (self.folder / "out/steps.jsonl").read_text().splitlines()
        return sum(json.loads(line)["newton_iterations"] for line in lines)

    def test_friction_that_settles_costs_at_most_twice_the_iterations(self):
        for task in ("drop.json", "roll.json"):
            self.assertLess(self.iterations(task), 2 * self.iterations(task, "--defaults", "polyfem"), task)


class Numbers(Case):
    """Scenes of their own geometry, loads and materials, and no key of method. A number that was wrong by defaults is right."""

    def sliding_block(self, steps, duration=1.0, by_force=False):
        """Pressed onto a ground, then moved along it; the ratio of friction to contact at the end."""
        rectangle(self.folder / "block.obj", 0.02, 0.01, 8, 4)
        along = f"0.005 * max(0, t / {duration} - 0.2)"
        down = f"min(1, 5 * t / {duration})"
        top = {"id": 4, "value": [along, f"-0.0002 * {down}"], "dimension": [True, not by_force]}
        scene = {"geometry": [{"mesh": "block.obj", "volume_selection": 1, "surface_selection": {"threshold": 1e-6}},
                              {"type": "ground", "height": -1e-5, "is_obstacle": True}],
                 "materials": {"type": "NeoHookean", "E": 1e6, "nu": 0.3, "rho": 1000},
                 "boundary_conditions": {"dirichlet_boundary": [top]},
                 "time": {"tend": duration, "time_steps": steps, "quasistatic": True},
                 "contact": {"enabled": True, "friction_coefficient": 0.2},
                 "output": {"forces": [{"name": "block", "bodies": 1}]}}
        if by_force:
            scene["boundary_conditions"]["neumann_boundary"] = [{"id": 4, "value": [0, f"-2e4 * {down}"]}]
        last = self.forces(scene)[-1]
        return -last["friction_x"] / last["contact_y"]

    def test_friction_does_not_depend_on_increments_or_on_the_unit_of_time(self):
        for steps, duration in ((10, 1), (100, 1), (1000, 1), (100, 1e-4), (100, 1e4)):
            self.assertAlmostEqual(self.sliding_block(steps, duration), 0.2, delta=0.001)
            self.assertAlmostEqual(self.sliding_block(steps, duration, by_force=True), 0.2, delta=0.001)

    def hook(self, more=None):
        """The forces along a beam that is pushed over a bump, nose first."""
        def nose(x, y):
            return x, y - 0.0015 * max(0, 1 - abs(x - 0.018) / 0.002) * (1 - y / 0.002)

        rectangle(self.folder / "hook.obj", 0.02, 0.002, 40, 4, nose)
        (self.folder / "bump.obj").write_text("v 0.0205 -0.003 0\nv 0.0225 -0.0005 0\nv 0.0245 -0.003 0\nl 1 2 3\n")
        scene = {"geometry": [{"mesh": "hook.obj", "volume_selection": 1, "surface_selection": {"threshold": 1e-6}},
                              {"mesh": "bump.obj", "is_obstacle": True}],
                 "materials": {"type": "NeoHookean", "E": 2e9, "nu": 0.35, "rho": 1000},
                 "boundary_conditions": {"dirichlet_boundary": [{"id": 1, "value": ["0.006 * t", 0]}]},
                 "time": {"dt": 0.0167, "time_steps": 60, "quasistatic": True},
                 "contact": {"enabled": True, "friction_coefficient": 0.3},
                 "output": {"forces": [{"name": "hook", "bodies": 1}]}}
        forces = [row["reaction_x"] for row in self.forces(merged(scene, more or {}))]
        return max(forces), min(forces)

    def test_a_hook_snaps_in_and_holds_as_with_converged_friction(self):
        found = self.hook()
        warnings = [line for line in self.words.splitlines() if line.startswith("warning:")]
        self.assertEqual(len(warnings), 1, "forces before the first touch are round-off")
        self.assertRegex(warnings[0], r"about 3\.7 linear elements .* too large by about 24 %")
        right = self.hook({"solver": {"lagging_tolerance": 1e-8}, "time": {"step_cuts": 0}})
        one_round = self.hook({"solver": {"contact": {"friction_iterations": 1}}})
        for force, expected, before in zip(found, right, one_round):
            self.assertAlmostEqual(force / expected, 1, delta=0.005)
            self.assertGreater(abs(before / expected - 1), 0.05)

    def test_a_wheel_rolls_as_fast_as_it_should(self):
        disc(self.folder / "wheel.obj", 0.05, 3, 48)
        slope, steps, dt = math.radians(10), 200, 0.005
        self.run_scene({"geometry": [{"mesh": "wheel.obj", "volume_selection": 1,
                                      "transformation": {"translation": [0, 0.05005]}}, {"type": "ground", "is_obstacle": True}],
                        "materials": {"type": "NeoHookean", "E": 1e7, "nu": 0.3, "rho": 1000},
                        "boundary_conditions": {"rhs": [-9.81 * math.sin(slope), 9.81 * math.cos(slope)]},
                        "time": {"dt": dt, "time_steps": steps},
                        "contact": {"enabled": True, "friction_coefficient": 0.5},
                        "output": {"paraview": {"skip_frame": steps, "options": {"momentum": True}}}})
        mass = 1000 * 24 * 0.05**2 * math.sin(2 * math.pi / 48)
        with h5py.File(self.folder / f"out/frames/{steps:06}.h5") as file:
            speed = file["totals/momentum"][0] / mass
        self.assertAlmostEqual(speed / (2 / 3 * 9.81 * math.sin(slope) * steps * dt), 1, delta=0.01)

    def test_a_wheel_of_twelve_corners_rolls_as_the_circle_that_it_is(self):
        radius, gap, steps, dt, slope = 0.05, 5e-5, 60, 0.002, math.radians(20)
        disc(self.folder / "wheel.obj", radius, 2, 12)
        scene = {"geometry": [{"mesh": "wheel.obj", "volume_selection": 1, "surface_selection": 3,
                               "transformation": {"translation": [0, radius + gap]}}, {"type": "ground", "is_obstacle": True}],
                 "shapes": [{"surface": 3, "type": "circle", "center": [0, radius + gap], "radius": radius}],
                 "materials": {"type": "NeoHookean", "E": 1e7, "nu": 0.3, "rho": 1000},
                 "boundary_conditions": {"rhs": [-9.81 * math.sin(slope), 9.81 * math.cos(slope)]},
                 "time": {"dt": dt, "time_steps": steps},
                 "contact": {"enabled": True, "friction_coefficient": 0.5},
                 "space": {"remesh": {"enabled": True}},
                 "output": {"checkpoint_period": 0, "paraview": {"skip_frame": steps // 2, "options": {"momentum": True}}}}
        speeds = []

        def last(folder, step=steps):
            with h5py.File(self.folder / folder / f"frames/{step:06}.h5") as file:
                return {"rest": file["mesh/rest"][:], "cells": file["mesh/simplices"][:], "x": file["fields/x"][:],
                        "v": file["fields/v"][:], "momentum": file["totals/momentum"][:]}
        self.run_scene(scene)
        for step in (steps // 2, steps):
            state = last("out", step)
            (ax, ay), (bx, by), (cx, cy) = (state["rest"][state["cells"][:, k]].T for k in range(3))
            area = ((bx - ax) * (cy - ay) - (by - ay) * (cx - ax)).sum() / 2
            speeds.append(state["momentum"][0] / (1000 * area))
        self.assertAlmostEqual((speeds[1] - speeds[0]) / (2 / 3 * 9.81 * math.sin(slope) * dt * (steps // 2)), 1, delta=0.01)
        self.assertGreater(area, 12 / 2 * radius**2 * math.sin(2 * math.pi / 12))
        with open(self.folder / "out/summary.json") as file:
            self.assertNotEqual(json.load(file)["shape_energy"], 0)
        # Two threads, and a run that goes on from the middle, give the same bits.
        path = self.write(scene)
        self.call("run", path, "-o", self.folder / "two", "--threads", 2)
        self.call("run", path, "-o", self.folder / "cut", "--threads", 1, "--set", f"/time/time_steps={steps // 2}")
        self.call("run", path, "-o", self.folder / "cut", "--threads", 1, "--resume")
        for folder in ("two", "cut"):
            other = last(folder)
            for name, values in state.items():
                self.assertEqual(values.tolist(), other[name].tolist(), (folder, name))

    def test_a_thin_wall_that_touches_nothing_feels_no_contact(self):
        box(self.folder / "wall.msh", (0.004, 0.004, 0.001), (4, 4, 1))
        held = [{"id": 5, "value": [0, 0, 0], "dimension": [False, False, True]},
                {"id": 6, "value": [0, 0, "-0.0003 * t"], "dimension": [False, False, True]},
                {"id": 1, "value": [0, 0, 0], "dimension": [True, False, False]},
                {"id": 2, "value": [0, 0, 0], "dimension": [False, True, False]}]
        scene = {"geometry": {"mesh": "wall.msh", "surface_selection": {"threshold": 1e-7}},
                 "materials": {"type": "NeoHookean", "E": 1e6, "nu": 0.3, "rho": 1000},
                 "boundary_conditions": {"dirichlet_boundary": held},
                 "time": {"dt": 0.25, "tend": 1, "quasistatic": True},
                 "output": {"forces": [{"name": "foot", "surfaces": 5}]}}
        alone = self.forces(scene)[-1]["all_z"]
        with_contact = self.forces({**scene, "contact": {"enabled": True}})
        self.assertEqual(with_contact[0]["all_z"], 0)
        self.assertAlmostEqual(with_contact[-1]["all_z"] / alone, 1, delta=1e-6)
        with_dhat_of_polyfem = self.forces({**scene, "contact": {"enabled": True, "dhat": 1e-3}})[-1]["all_z"]
        self.assertGreater(abs(with_dhat_of_polyfem / alone - 1), 0.1)

    def test_plates_that_stick_hardly_creep(self):
        rectangle(self.folder / "plate.obj", 0.2, 0.02, 10, 1)
        slope, length = math.radians(15), 0.2
        plates = [{"mesh": "plate.obj", "volume_selection": k + 1, "transformation": {"translation": [0, 1e-5 + k * 0.02001]}}
                  for k in range(3)]
        self.run_scene({"geometry": [{"type": "ground", "is_obstacle": True}, *plates],
                        "materials": {"type": "NeoHookean", "E": 1e8, "nu": 0.3, "rho": 1000},
                        "boundary_conditions": {"rhs": [-9.81 * math.sin(slope), 9.81 * math.cos(slope)]},
                        "time": {"dt": 0.01, "time_steps": 1100},
                        "contact": {"enabled": True, "friction_coefficient": 0.5},
                        "output": {"paraview": {"skip_frame": 100}}})
        with h5py.File(self.folder / "out/frames/000100.h5") as begin, h5py.File(self.folder / "out/frames/001100.h5") as end:
            creep = abs(end["fields/u"][:, 0] - begin["fields/u"][:, 0]).max()
        self.assertLess(creep, 1e-4 * length)


class Reports(Case):
    """What runs report of small scenes with closed forms, and what they refuse."""

    def block(self, name="block.obj", **keys):
        rectangle(self.folder / name, 1, 1, 4, 4)
        return {"mesh": name, "volume_selection": 1, "surface_selection": {"threshold": 1e-6}, **keys}

    def soft(self, **more):
        return {"materials": {"type": "NeoHookean", "E": 1e4, "nu": 0.3, "rho": 1000}, **more}

    def test_a_spring_of_a_rigid_body_has_its_force_in_its_curve(self):
        block = self.block(rigid={"held": ["x", "rz"], "force": [0, -100]})
        del block["volume_selection"]
        rows = self.forces({"geometry": block, "springs": [{"id": 2, "stiffness": 1000, "name": "ground"}],
                            "time": {"quasistatic": True, "dt": 1, "tend": 1},
                            "output": {"forces": [{"name": "block", "bodies": 0}]}})[-2:]
        of = {row["name"]: row for row in rows}
        self.assertAlmostEqual(of["ground"]["all_y"], 100, delta=1e-6)
        self.assertAlmostEqual(of["block"]["all_y"], 100, delta=1e-6)
        self.assertAlmostEqual(of["block"]["body_y"], -100, delta=1e-6)

    def test_increments_have_no_kinetic_energy(self):
        held = [{"id": 2, "value": [0, 0]}, {"id": 4, "value": [0, "0.1 * t"]}]
        scene = self.soft(geometry=self.block(), boundary_conditions={"dirichlet_boundary": held},
                          time={"quasistatic": True, "dt": 0.1, "tend": 0.1},
                          output={"paraview": {"options": {"kinetic_energy": True, "momentum": True}}})
        self.run_scene(scene)
        with h5py.File(self.folder / "out/frames/000001.h5") as frame:
            self.assertEqual(frame["totals/kinetic_energy"][0], 0)
            self.assertFalse(frame["totals/momentum"][:].any())
            self.assertTrue(frame["fields/v"][:].any())

    def test_a_rim_that_is_held_along_the_axis_bears_the_pressure_on_the_deformed_disc(self):
        rectangle(self.folder / "disc.obj", 1, 0.2, 10, 2)
        sides = [{"id": 3, "axis": "y", "position": 0.1999}, {"id": 2, "axis": "x", "position": 0.9999}]
        rows = self.forces(self.soft(
            geometry={"mesh": "disc.obj", "surface_selection": sides}, axisymmetric=True,
            boundary_conditions={"dirichlet_boundary": [{"id": 2, "value": [0, 0], "dimension": [False, True]}],
                                 "pressure_boundary": [{"id": 3, "value": 400}]},
            output={"forces": [{"name": "disc", "bodies": 0}], "points": [{"name": "rim", "rest": [1, 0.2]}]}))
        with open(self.folder / "out/points.csv") as file:
            radius = float(list(csv.DictReader(file))[-1]["x"])
        self.assertGreater(abs(radius - 1), 1e-3)
        self.assertAlmostEqual(rows[-1]["reaction_y"] / (400 * math.pi * radius**2), 1, delta=1e-8)
        self.assertAlmostEqual(rows[-1]["all_y"], 0, delta=1e-6)

    def test_sums_of_laws_that_are_nearly_incompressible_end_where_solves_are_inexact(self):
        box(self.folder / "cube.msh", (1e-3,) * 3, (1, 1, 1))
        laws = [{"type": "IsochoricNeoHookean", "E": 5000, "nu": 0.3}, {"type": "VolumePenalty", "k": 1e10}]
        sides = [{"id": 1, "axis": "-x", "position": 1e-5}, {"id": 2, "axis": "x", "position": 0.99e-3}]
        held = [{"id": i, "value": [25e-6 * (i - 1), 0, 0], "dimension": [True, False, False]} for i in (1, 2)]
        scene = {"defaults": "polyfem", "geometry": {"mesh": "cube.msh", "surface_selection": sides},
                 "materials": {"type": "MaterialSum", "models": laws, "rho": 1}, "space": {"discr_order": 2},
                 "boundary_conditions": {"dirichlet_boundary": held}, "time": {"dt": 0.2, "time_steps": 1},
                 "solver": {"linear": {"solver": "eigen"}, "nonlinear": {"max_iterations": 500}}}
        self.assertIn("nearly singular system were inexact", self.run_scene(scene))

    def test_places_of_two_bodies_and_motions_of_nothing_held_are_refused(self):
        pair = [self.block(), self.block(volume_selection=2, transformation={"translation": [1, 0]})]
        held = {"dirichlet_boundary": [{"id": 1, "value": [0, 0]}]}
        points = {"points": [{"name": "p", "rest": [1, 0]}]}
        words = self.call("run", self.write(self.soft(geometry=pair, boundary_conditions=held, output=points)), status=2)
        self.assertIn("/output/points/0/rest: found (1, 0) m, where bodies 1 and 2 both are", words)
        point = {"id": 3, "held": ["x"], "motion": [0.1, 0.2]}
        scene = self.soft(geometry=self.block(), boundary_conditions=held, couplings=[point])
        self.assertIn("/couplings/0/motion/1: found 0.2, which has no effect", self.call("run", self.write(scene), status=2))

    def test_rigid_bodies_that_overlap_are_named(self):
        rigid = [self.block(rigid={"held": held}, transformation={"translation": [0.1 * i, 0.9 * i]})
                 for i, held in enumerate((["x", "y", "rz"], ["x", "y"]))]
        words = self.call("run", self.write({"geometry": rigid, "contact": {"enabled": True, "initial_overlap": "resolve"},
                                             "time": {"quasistatic": True, "dt": 1, "tend": 1}}), status=2)
        self.assertIn("which are rigid and are not free to part", words)
        self.assertNotIn("line search", words)

    def test_numbers_in_degrees_and_of_other_units_are_asked_about(self):
        def words(rhs=(0, 9.81), **changes):
            material = {"type": "NeoHookean", "E": 1e7, "nu": 0.3, "rho": 1000, **changes.pop("material", {})}
            return self.call("explain", self.write({"geometry": self.block(), "materials": material, "time": {"dt": 1, "tend": 1},
                                                    "boundary_conditions": {"rhs": list(rhs)}, **changes}))
        degrees = words(rhs=["9.81 * sin(30)", "9.81 * cos(deg2rad(30))"])
        self.assertIn("/boundary_conditions/rhs: sin(30) is of radians, of more than a full turn; deg2rad() takes degrees", degrees)
        steel = {"E": 210000, "rho": 7850}
        self.assertIn("E = 2.1e+05 Pa is unusual at a density of 7850 kg/m^3: are moduli in Pa?", words(material=steel))
        still = {"time": {"dt": 1, "tend": 1, "quasistatic": True},
                 "boundary_conditions": {"dirichlet_boundary": [{"id": 2, "value": [0, 0]}]}}
        tonnes = words(units={"length": "mm", "mass": "t", "time": "s"}, **still)
        self.assertIn("rho = 1e+03 t/mm^3 is unusual", tonnes)
        self.assertIn("rho = 1.1e-09 kg/m^3 is unusual", words(material={"E": 2000, "rho": 1.1e-9}, **still))
        self.assertNotIn("is unusual", words(material={"rho": 1}, **still))
        usual = words()
        for part in ("is of radians", "is unusual"):
            self.assertNotIn(part, usual)

    def test_explain_leaves_out_averaged_gaps_where_they_are_off(self):
        scene = self.soft(geometry=self.block(), contact={"enabled": True, "friction_coefficient": 0.2})
        self.assertIn("/contact/average_gaps", self.call("explain", self.write(scene)))
        self.assertNotIn("/contact/average_gaps", self.call("explain", self.write({**scene, "space": {"discr_order": 2}})))


if __name__ == "__main__":
    ITR, SOURCE = sys.argv[1:3]
    unittest.main(argv=[sys.argv[0], *sys.argv[3:]])
