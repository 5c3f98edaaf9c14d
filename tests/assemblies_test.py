#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""The scenes of examples/assemblies: what make.py makes is committed, all are accepted and have no key of method, and short ones
run, pass their certificates and meet their references. Arguments: the command, the source folder."""
import csv
import json
import pathlib
import subprocess
import sys
import tempfile
import unittest

ITR, SOURCE = sys.argv[1], pathlib.Path(sys.argv[2]).resolve()
HERE = SOURCE / "examples/assemblies"
sys.path.insert(0, str(HERE))
import make  # noqa: E402
import study  # noqa: E402

OF_METHOD = {"solver", "dhat", "epsv", "dhat_percentage", "use_convergent_formulation", "step_cuts", "integrator", "defaults"}


def keys(value):
    if isinstance(value, dict):
        return set(value) | set().union(*map(keys, value.values()))
    return set().union(*map(keys, value)) if isinstance(value, list) else set()


def call(*words):
    done = subprocess.run([ITR, *map(str, words)], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr


class Assemblies(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.scratch = tempfile.TemporaryDirectory()
        cls.folder = pathlib.Path(cls.scratch.name)
        make.facets = lambda radius: 40  # coarse rings are enough to be accepted
        make.make(cls.folder)

    @classmethod
    def tearDownClass(cls):
        cls.scratch.cleanup()

    def test_what_is_committed_is_what_the_script_makes(self):
        self.assertEqual({path.stem for path in HERE.glob("*.json")}, set(make.SCENES))
        for path in [*HERE.glob("*.json"), *HERE.glob("meshes/*")]:
            self.assertEqual(path.read_text(), (self.folder / path.relative_to(HERE)).read_text(), path)
            self.assertLess(path.stat().st_size, 100_000, path)

    def test_page_has_the_stored_table(self):
        self.assertIn(study.table(), (HERE / "README.md").read_text())

    def test_each_is_accepted_and_has_no_key_of_method(self):
        for name in make.SCENES:
            with self.subTest(name):
                scene = self.folder / f"{name}.json"
                self.assertFalse(keys(json.loads(scene.read_text())) & OF_METHOD)
                call("explain", scene)

    def test_a_solid_press_fit_with_flush_sides_begins(self):
        """Its edges, which lie in the flush sides of both rings, once were pushed out through these sides and never apart."""
        call("run", self.folder / "press_fit_3d.json", "-o", self.folder / "solid", "--threads", 1)
        call("certify", self.folder / "solid")
        pressure = study.STUDIES["press_fit_3d"][0](self.folder / "solid")["pressure"]
        self.assertAlmostEqual(pressure / study.LAME["pressure"], 1, delta=0.4)  # facets sag by 0.4 of the overlap
        warnings = json.loads((self.folder / "solid/summary.json").read_text())["warnings"]
        self.assertTrue(any("mesh the round finer" in warning["text"] for warning in warnings))

    def test_short_ones_meet_their_references(self):
        for name, most in (("press_fit_axisymmetric", 0.5), ("shrink_fit", 0.5), ("laid_down", 1), ("rubber_mount", 3)):
            with self.subTest(name), open(HERE / "study" / f"{name}.csv", newline="") as file:
                row = next(csv.DictReader(file))
                results, _ = study.run(ITR, self.folder / "runs", name, 0)
                for key, value in study.STUDIES[name][0](results).items():
                    self.assertLess(abs(value / float(row[f"{key}: reference"]) - 1), most / 100, f"{key}: {value}")


if __name__ == "__main__":
    del sys.argv[1:]
    unittest.main()
