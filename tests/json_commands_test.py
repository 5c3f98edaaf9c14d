#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Facts as JSON: `itr distance` on a stretched unit square, whose displacement is known on any mesh, `itr certify --json` of the
same runs, `itr explain --json`, and profile.jsonl. Argument: the command."""
import json
import pathlib
import struct
import subprocess
import sys
import tempfile
import unittest

ITR = sys.argv.pop()

SQUARE = """$MeshFormat
2.2 0 8
$EndMeshFormat
$Nodes
4
1 0 0 0
2 1 0 0
3 1 1 0
4 0 1 0
$EndNodes
$Elements
2
1 2 2 1 1 1 2 3
2 2 2 1 1 1 3 4
$EndElements
"""


def facts(*arguments, status=0):
    done = subprocess.run([ITR, *arguments], capture_output=True, text=True)
    assert done.returncode == status, (done.returncode, done.stderr)
    return json.loads(done.stdout) if done.stdout else done.stderr


def distance(*arguments, status=0):
    return facts("distance", *arguments, status=status)


class Runs(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.temporary = tempfile.TemporaryDirectory()
        cls.folder = pathlib.Path(cls.temporary.name)
        (cls.folder / "square.msh").write_text(SQUARE)
        cls.scenes = []

    @classmethod
    def tearDownClass(cls):
        cls.temporary.cleanup()

    def run_stretched(self, stretch, n_refs, more=None):
        """The folder of a run whose displacement is (stretch * t * x, 0)."""
        path = self.write_scene(stretch, n_refs, more)
        folder = path.with_suffix("")
        subprocess.run([ITR, "run", path, "-o", folder], check=True, capture_output=True)
        return folder

    def write_scene(self, stretch=0, n_refs=0, more=None):
        path = self.folder / f"{stretch}-{n_refs}-{len(self.scenes)}.json"
        self.scenes.append(path)
        scene = {"geometry": [{"mesh": "square.msh", "n_refs": n_refs, "surface_selection": 1}],
                 "materials": {"type": "LinearElasticity", "E": 1000, "nu": 0.3, "rho": 1},
                 "boundary_conditions": {"dirichlet_boundary": [{"id": 1, "value": [f"{stretch} * t * x", 0]}]},
                 "time": {"dt": 0.5, "tend": 1, "quasistatic": True}, **(more or {})}
        path.write_text(json.dumps({key: value for key, value in scene.items() if value is not None}))
        return path


class Distance(Runs):
    def test_of_linear_fields_is_that_of_the_functions_whatever_the_meshes(self):
        coarse, fine = self.run_stretched(0.1, 0), self.run_stretched(0.2, 2)
        found = distance(coarse, fine)
        self.assertEqual(set(found), {"l2", "h1", "surface", "energy", "momentum", "reference_energy", "times"})
        self.assertEqual(found["times"], 2)
        # u = u_ref / 2 at all times; the right sides of the squares are 0.05 and 0.1 apart.
        self.assertAlmostEqual(found["l2"], 0.5, delta=1e-9)
        self.assertAlmostEqual(found["h1"], 0.5, delta=1e-9)
        self.assertAlmostEqual(found["surface"], 0.1, delta=1e-3 * 0.1)
        self.assertEqual(found["momentum"], 0)
        # Elastic energy is quadratic: (lambda / 2 + mu) strain^2 with the lambda of plane stress, E nu / (1 - nu^2).
        factor = 1000 * 0.3 / (1 - 0.3**2) / 2 + 1000 / 2.6
        energies = [factor * strain**2 for strain in (0.1, 0.2)]
        self.assertAlmostEqual(found["reference_energy"], (sum(e * e for e in energies) / 2) ** 0.5, delta=1e-7)
        differences = [factor * (strain**2 - (strain / 2) ** 2) for strain in (0.1, 0.2)]
        self.assertAlmostEqual(found["energy"], (sum(d * d for d in differences) / 2) ** 0.5, delta=1e-7)
        last = distance(coarse, fine, "--last")
        self.assertEqual(last["times"], 1)
        self.assertAlmostEqual(last["l2"], 0.5, delta=1e-9)
        self.assertAlmostEqual(last["energy"], differences[1], delta=1e-7)

    def test_statics_have_one_time_and_dynamics_need_momentum(self):
        a = self.run_stretched(0.1, 0, {"time": None})
        b = self.run_stretched(0.2, 1, {"time": None, "units": {"time": "ms"}})
        found = distance(a, b)
        self.assertEqual(found["times"], 1)
        self.assertAlmostEqual(found["l2"], 0.5, delta=1e-9)
        dynamic = {"time": {"dt": 0.5, "tend": 1}}
        found = distance(self.run_stretched(0.1, 0, dynamic), self.run_stretched(0.1, 1, dynamic))
        self.assertEqual((found["energy"], found["momentum"]), (None, None))
        asked = dynamic | {"output": {"paraview": {"options": {"kinetic_energy": True, "momentum": True}}}}
        found = distance(self.run_stretched(0.1, 0, asked), self.run_stretched(0.2, 1, asked))
        self.assertGreater(found["momentum"], 0)
        self.assertGreater(found["energy"], 0)

    def test_bad_input_is_named(self):
        run = self.run_stretched(0.1, 0)
        nothing = self.folder / "nothing"
        self.assertIn(f"{nothing}: found no such folder; expected a folder of a run", distance(nothing, run, status=2))
        self.assertIn("nothing/steps.jsonl: found no such file; expected", distance(run, nothing, status=2))
        other_times = self.run_stretched(0.1, 0, {"time": {"dt": 0.3, "tend": 0.3, "quasistatic": True}})
        self.assertIn("frames: found no frame at a time of", distance(run, other_times, status=2))
        (self.folder / "square.msh").write_text(SQUARE.replace("2 1 0 0", "2 2 0 0"))
        other_shape = self.run_stretched(0.1, 0)
        (self.folder / "square.msh").write_text(SQUARE)
        self.assertIn("/mesh/rest: found bodies of which", distance(run, other_shape, status=2))
        with open(run / "steps.jsonl", "a") as log:
            log.write("{broken\n")
        self.assertIn("steps.jsonl: line 4: found {broken; expected JSON", distance(run, other_shape, status=2))
        distance(run, status=2)


class Profile(Runs):
    def test_each_moment_is_in_one_phase_and_results_stay(self):
        # Accelerated: a step that goes on as the last one did has nothing to solve.
        motion = {"dirichlet_boundary": [{"id": 1, "value": ["0.1 * t^2 * x^2", 0]}]}
        path = self.write_scene(0, 3, {"boundary_conditions": motion})
        folders = [path.with_suffix(name) for name in (".plain", ".profiled")]
        subprocess.run([ITR, "run", path, "-o", folders[0]], check=True, capture_output=True)
        subprocess.run([ITR, "run", path, "-o", folders[1], "--profile", "--threads", "1"], check=True, capture_output=True)
        self.assertFalse((folders[0] / "profile.jsonl").exists())
        lines = [json.loads(line) for line in (folders[1] / "profile.jsonl").read_text().splitlines()]
        self.assertEqual([(line["step"], line["threads"]) for line in lines], [(1, 1), (2, 1)])
        for line in lines:
            phases = {phase["phase"]: phase for phase in line["phases"]}
            self.assertLessEqual({"assembly of elastic", "solve", "output", "rest"}, set(phases))
            for phase in phases.values():
                self.assertLessEqual(phase["span"], phase["predicted"]["64"] * (1 + 1e-9))
                self.assertLessEqual(phase["predicted"]["64"], phase["predicted"]["2"])
                self.assertLessEqual(phase["predicted"]["2"], phase["work"] * (1 + 1e-9))
        self.assertEqual(distance(*folders)["l2"], 0)


class Certify(Runs):
    def test_flight_is_by_the_size_of_the_scene(self):
        certificate = facts("certify", self.run_stretched(0.5, 1), "--json")
        self.assertEqual((certificate["frames"], certificate["passed"], certificate["violations"]), (3, True, []))
        self.assertAlmostEqual(certificate["flight"], 0.25 / 2**0.5, delta=1e-6)  # mean displacement, over the square's diagonal
        self.assertEqual((certificate["overhang"], certificate["length"]), (0, "m"))

    def test_violations_have_their_kind(self):
        folder = self.run_stretched(0.1, 0)
        frame = sorted(folder.glob("frames/*.h5"))[-1]
        content = frame.read_bytes()
        rest, other = (struct.pack("<8d", 0, 0, 1, 0, 1, 1, x, 1) for x in (0, 1.5))  # the last vertex across the diagonal
        self.assertIn(rest, content)
        content = content.replace(rest, other)
        for content, of in ((content, "file"), (content.replace(b"digests", b"Digests"), "cells")):  # as of before there were digests
            frame.write_bytes(content)
            certificate = facts("certify", folder, "--json", status=4)
            self.assertEqual([violation["of"] for violation in certificate["violations"]], [of])
            self.assertIn(frame.name, certificate["violations"][0]["text"])
            self.assertFalse(certificate["passed"])


class Explain(Runs):
    def explain(self, more=None, *words, n_refs=0):
        return facts("explain", self.write_scene(0.1, n_refs, more), "--json", *words)

    def test_tells_what_a_scene_is(self):
        found = self.explain(n_refs=1)
        self.assertEqual((found["dim"], found["cells"], found["bodies"]), (2, 8, [1]))
        self.assertEqual(found["box"], [[0, 0], [1, 1]])
        self.assertEqual(found["time"], {"static": False, "quasistatic": True, "dt": 0.5, "steps": 2})
        self.assertEqual(found["scene"]["geometry"][0]["n_refs"], 1)
        self.assertEqual((found["contact"], found["friction"]), (False, False))
        self.assertIn("eigen:ldlt", found["solvers"])
        found = self.explain({"time": None}, "--set", "/geometry/0/n_refs=2")
        self.assertEqual((found["cells"], found["time"]["static"]), (32, True))

    def test_tells_the_values_that_the_scene_leaves_open(self):
        """docs/theory.md: strains of a tenth everywhere, a thousandth of a thousandth of their energy."""
        key, stiffness = "/space/remesh/{}/acceptance_tolerance", "/solver/contact/barrier_stiffness"
        own = self.explain()["settings"]
        self.assertNotIn(stiffness, own)
        self.assertAlmostEqual(own[key.format("collapse")], -0.01 * own[key.format("split")], delta=1e-15)
        asked = self.explain({"space": {"remesh": {"split": {"acceptance_tolerance": 3}, "swap": {"acceptance_tolerance": 2}}}})["settings"]
        self.assertEqual([asked[key.format(name)] for name in ("split", "collapse", "swap")], [3, -0.03, 2])
        touching = {"contact": {"enabled": True, "dhat": 1e-2, "friction_coefficient": 0.2}}
        found = self.explain(touching)
        self.assertTrue(found["contact"] and found["friction"])
        self.assertGreater(found["settings"][stiffness], 0)
        self.assertNotIn("/contact/dhat", found["settings"])
        self.assertGreater(self.explain(touching, "--set", '/contact/dhat="auto"')["settings"]["/contact/dhat"], 0)
        self.assertNotIn(stiffness, self.explain(touching | {"solver": {"contact": {"barrier_stiffness": 7}}})["settings"])

    def test_numbers_are_in_the_scene_s_units(self):
        split = "/space/remesh/split/acceptance_tolerance"
        units = {"units": {"length": "mm", "time": "ms", "mass": "g"}}
        found, si = self.explain(units), self.explain()
        self.assertEqual((found["units"]["length"], found["units"]["in_si"]["m"], found["units"]["in_si"]["s"]), ("mm", 1e-3, 1e-3))
        self.assertEqual((found["box"], found["time"]["dt"]), ([[0, 0], [1, 1]], 0.5))
        # Equal numbers are another body here: of modulus 1000 g / (mm ms^2), 1 mm x 1 mm, by mm of thickness.
        self.assertAlmostEqual(found["settings"][split], si["settings"][split], delta=1e-12 * si["settings"][split])

    def test_wrong_scenes_are_named(self):
        done = subprocess.run([ITR, "explain", self.write_scene(), "--json", "--set", "/time/dtt=1"], capture_output=True, text=True)
        self.assertEqual((done.returncode, done.stdout), (2, ""))
        self.assertIn("/time/dtt", done.stderr)


if __name__ == "__main__":
    unittest.main()
