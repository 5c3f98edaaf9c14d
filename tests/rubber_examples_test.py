#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Scenes of examples: all are valid, those of rubber are as make.py makes them, and the shear test has its closed form.
Arguments: the command, the source folder."""
import csv
import json
import pathlib
import subprocess
import sys
import tempfile
import unittest

SOURCE = pathlib.Path(sys.argv.pop())
ITR = sys.argv.pop()
RUBBER = SOURCE / "examples/rubber"
sys.path.insert(0, str(RUBBER))
import make  # noqa: E402
import study  # noqa: E402


def call(*words):
    done = subprocess.run([ITR, *words], capture_output=True, text=True)
    assert done.returncode == 0, (words, done.stdout, done.stderr)
    return done


class Examples(unittest.TestCase):
    def setUp(self):
        self.temporary = tempfile.TemporaryDirectory()
        self.folder = pathlib.Path(self.temporary.name)

    def tearDown(self):
        self.temporary.cleanup()

    def test_all_scenes_are_valid(self):
        """Those of the tutorial and of assemblies, whose scripts make their meshes, are in tests of their own."""
        scenes = [path for path in sorted(SOURCE.glob("examples/**/*.json"))
                  if path.parent.name not in ("assemblies", "study", "tutorial")]
        self.assertGreater(len(scenes), 15)
        for scene in scenes:
            call("explain", scene)

    def test_committed_scenes_are_those_that_the_script_makes(self):
        names = [name for name in make.PARTS if name != "lip_seal"]  # whose mesh is gmsh's
        make.write(self.folder, names)
        made = {path.name: path.read_text() for path in self.folder.iterdir()}
        self.assertEqual(made, {name: (RUBBER / name).read_text() for name in made})
        self.assertEqual(json.loads((RUBBER / "lip_seal.json").read_text()), make.PARTS["lip_seal"].content())

    def test_shear_test_has_its_closed_form(self):
        run = self.folder / "run"
        said = call("run", RUBBER / "shear.json", "-o", run, "--threads", "1")
        self.assertNotIn("warning", said.stdout + said.stderr)
        call("certify", run)
        case = study.CASES["shear"]
        self.assertAlmostEqual(case.value(run) / case.reference, 1, delta=0.01)

    def test_pages_have_the_stored_table(self):
        self.assertIn(study.table(), (RUBBER / "README.md").read_text())
        for name in study.CASES:
            with open(study.STUDY / f"{name}.csv", newline="") as file:
                errors = [abs(float(row["error [%]"])) for row in csv.DictReader(file)]
            self.assertLess(errors[-1], 3, name)


if __name__ == "__main__":
    unittest.main()
