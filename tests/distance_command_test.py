#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""`itr distance` on a stretched unit square, whose displacement is known on any mesh. Argument: the command."""
import json
import pathlib
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


def distance(*arguments, status=0):
    done = subprocess.run([ITR, "distance", *arguments], capture_output=True, text=True)
    assert done.returncode == status, (done.returncode, done.stderr)
    return json.loads(done.stdout) if status == 0 else done.stderr


class Distance(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.temporary = tempfile.TemporaryDirectory()
        cls.folder = pathlib.Path(cls.temporary.name)
        (cls.folder / "square.msh").write_text(SQUARE)
        cls.runs = {}

    @classmethod
    def tearDownClass(cls):
        cls.temporary.cleanup()

    def run_stretched(self, stretch, n_refs, more=None):
        """The folder of a run whose displacement is (stretch * t * x, 0)."""
        folder = self.folder / f"{stretch}-{n_refs}-{len(self.runs)}"
        self.runs[folder] = stretch
        scene = {"geometry": [{"mesh": "square.msh", "n_refs": n_refs, "surface_selection": 1}],
                 "materials": {"type": "LinearElasticity", "E": 1000, "nu": 0.3, "rho": 1},
                 "boundary_conditions": {"dirichlet_boundary": [{"id": 1, "value": [f"{stretch} * t * x", 0]}]},
                 "time": {"dt": 0.5, "tend": 1, "quasistatic": True}, **(more or {})}
        path = folder.with_suffix(".json")
        path.write_text(json.dumps({key: value for key, value in scene.items() if value is not None}))
        subprocess.run([ITR, "run", path, "-o", folder], check=True, capture_output=True)
        return folder

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


if __name__ == "__main__":
    unittest.main()
