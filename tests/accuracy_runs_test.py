#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Runs with "accuracy": the true error against a finer run, what the command says, and the same bits after --resume.
Arguments: the command, the source folder."""
import json
import pathlib
import subprocess
import sys
import tempfile
import types
import unittest

SOURCE = pathlib.Path(sys.argv.pop())
ITR = sys.argv.pop()
sys.path.insert(0, str(SOURCE / "verification/adaptive"))
import accuracy  # noqa: E402


class Runs(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = pathlib.Path(cls.enterClassContext(tempfile.TemporaryDirectory()))

    def check_true_errors(self, name, scene):
        errors = []
        for row in accuracy.compare(ITR, name, scene, self.folder):
            if not row["asked"]:
                continue
            errors.append(row["true"])
            self.assertLess(row["true"], 2 * row["asked"], row)
            self.assertEqual("not reached" not in row["said"], row["estimated"] <= row["asked"] * 1.05, row)
        self.assertEqual(len(errors), 3)
        return errors

    def test_quasistatic_and_remeshed(self):
        errors = self.check_true_errors("cook pulled", accuracy.SCENES["cook pulled"])
        self.assertLess(errors[2], errors[0] / 2, "a tighter accuracy gives a smaller error")

    def test_dynamics(self):
        scene = accuracy.Scene(accuracy.plucked, end=0.1, tolerance=3e-3, times=20, remesh=False)
        self.check_true_errors("beam plucked", scene)

    def test_contact(self):
        errors = self.check_true_errors("block pressed", accuracy.SCENES["block pressed"])
        self.assertLess(errors[2], errors[0] / 2, "a tighter accuracy gives a smaller error")

    def scene(self, name, changes=None):
        content = accuracy.SCENES["cook pulled"].content(types.SimpleNamespace(folder=self.folder))
        content["accuracy"] = 0.02
        content["time"]["output_dt"] = 0.1
        content["output"]["checkpoint_period"] = 0
        for key, value in (changes or {}).items():
            content[key] = {**content.get(key, {}), **value}
        path = self.folder / f"{name}.json"
        path.write_text(json.dumps(content))
        return path

    def call(self, *words, status=0):
        done = subprocess.run([ITR, *map(str, words)], capture_output=True, text=True)
        self.assertEqual(done.returncode, status, done.stderr)
        return done.stdout + done.stderr

    def test_explain_tells_what_follows_and_what_stays(self):
        said = self.call("explain", self.scene("told", {"space": {"remesh": {"enabled": True, "relative_tolerance": 0.01}}}))
        self.assertIn("accuracy 0.02: /time/tolerance = 0.0707: ", said)
        self.assertIn("accuracy 0.02: /space/remesh/relative_tolerance stays, as the scene sets it", said)
        fixed = self.call("run", self.scene("fixed", {"space": {"remesh": {"enabled": False}}}), "-o", self.folder / "fixed")
        self.assertIn("accuracy 0.02: the mesh is fixed, as /space/remesh/enabled is not true", fixed)
        self.assertIn("not reached: refine the mesh first, which is fixed", fixed)

    def test_resumed_run_has_the_same_bits(self):
        scene = self.scene("resumed")
        self.call("run", scene, "-o", self.folder / "through", "--threads", "1")
        self.call("run", scene, "-o", self.folder / "halves", "--threads", "1")
        for frame in sorted((self.folder / "halves/frames").glob("*.h5"))[5:]:
            frame.unlink()
        said = self.call("run", scene, "-o", self.folder / "halves", "--threads", "1", "--resume")

        def energies(name):
            return [json.loads(line)["energy"] for line in (self.folder / name / "steps.jsonl").read_text().splitlines()]
        self.assertGreater(len(energies("through")), 8)
        self.assertEqual(energies("through"), energies("halves"))
        self.assertIn("accuracy of the energy: 2 % asked", said)


if __name__ == "__main__":
    unittest.main()
