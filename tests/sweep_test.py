#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""`itr sweep` on the examples' cantilever. Arguments: the command, the folder of examples."""
import csv
import json
import pathlib
import signal
import subprocess
import sys
import tempfile
import time
import unittest

EXAMPLES = pathlib.Path(sys.argv.pop())
ITR = sys.argv.pop()
SCENE = EXAMPLES / "cantilever.json"
SMALL = ["--set", "/space/remesh/enabled=false", "--set", '/output/forces=[{"name":"left","surfaces":1}]']
PATIENCE = 120  # s, for a loaded machine


def sweep(*words, status=0):
    done = subprocess.run([ITR, "sweep", *words], capture_output=True, text=True)
    assert done.returncode == status, (done.returncode, done.stdout, done.stderr)
    return done


class Sweep(unittest.TestCase):
    def setUp(self):
        self.temporary = tempfile.TemporaryDirectory()
        self.folder = pathlib.Path(self.temporary.name) / "a sweep"

    def tearDown(self):
        self.temporary.cleanup()

    def plan(self, *words):
        sweep(SCENE, "-o", self.folder, *SMALL, *words)
        return (self.folder / "commands.txt").read_text().splitlines()

    def collect(self):
        said = sweep("--collect", self.folder).stdout
        with open(self.folder / "sweep.csv", newline="") as file:
            return said, list(csv.DictReader(file))

    def test_has_a_line_for_each_combination_and_collects_their_results(self):
        lines = self.plan("--vary", "/materials/0/E=1e6,2e6,4e6", "--vary", '/time/integrator=["ImplicitEuler","BDF2"]')
        self.assertEqual(len(lines), 6)
        said, rows = self.collect()
        self.assertEqual({row["outcome"] for row in rows}, {"none"})
        self.assertIn("0 of 6 runs are finished, 6 have not begun", said)
        for line in lines:
            subprocess.run(["sh", "-c", line], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        said, rows = self.collect()
        self.assertIn("6 of 6 runs are finished", said)
        self.assertEqual([(row["/materials/0/E"], row["/time/integrator"]) for row in rows],
                         [(E, name) for E in ("1000000.0", "2000000.0", "4000000.0") for name in ("ImplicitEuler", "BDF2")])
        for row in rows:
            self.assertEqual(row["outcome"], "finished")
            self.assertGreater(int(row["newton_iterations"]), 0)
            self.assertGreater(float(row["peak force left"]), 0)
        alone = self.folder / "alone"
        subprocess.run([ITR, "run", SCENE, "-o", alone, *SMALL, "--set", "/materials/0/E=2e6", "--set", '/time/integrator="BDF2"'],
                       check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        summary = json.loads((alone / "summary.json").read_text())
        self.assertEqual(float(rows[3]["energy"]), summary["energy"]["total"])

    def test_goes_on_after_it_was_killed(self):
        lines = self.plan("--vary", "/geometry/0/n_refs=2", "--set", "/time/dt=0.001")
        run = self.folder / "runs/0"
        process = subprocess.Popen(["sh", "-c", "exec " + lines[0]], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        end = time.monotonic() + PATIENCE
        while not (run / "steps.jsonl").exists() or len((run / "steps.jsonl").read_text().splitlines()) < 3:
            self.assertIsNone(process.poll())
            self.assertLess(time.monotonic(), end)
            time.sleep(0.01)
        process.send_signal(signal.SIGKILL)
        process.wait()
        said, rows = self.collect()
        self.assertEqual(rows[0]["outcome"], "unfinished")
        self.assertEqual(self.plan("--vary", "/geometry/0/n_refs=2", "--set", "/time/dt=0.001"), lines)
        done = subprocess.run(["sh", "-c", lines[0] + " --set /time/tend=0.01"], capture_output=True, text=True)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("going on after step", done.stdout + done.stderr)
        said, rows = self.collect()
        self.assertEqual(rows[0]["outcome"], "finished")

    def test_refuses_another_sweep_in_its_folder(self):
        self.plan("--vary", "/materials/0/E=1e6,2e6")
        for others in (["/materials/0/E=1e6,3e6"], ["/materials/0/E=1e6,2e6", "--defaults", "polyfem"]):
            refused = sweep(SCENE, "-o", self.folder, *SMALL, "--vary", *others, status=2)
            self.assertIn("another sweep", refused.stderr)
            self.assertIn("sweep.json", refused.stderr)

    def test_refuses_values_that_a_run_refuses(self):
        for value, text in (("/materials/0/EE=1,2", "/materials/0/EE: found an unknown key"), ("/materials/0/nu=0.3,0.5", "/materials/0/nu: found 0.5")):
            refused = sweep(SCENE, "-o", self.folder, *SMALL, "--vary", value, status=2)
            self.assertIn(text, refused.stderr)
            self.assertFalse(self.folder.exists())

    def test_refuses_what_it_cannot_read(self):
        for words, text in ((["--vary", "E=1,2"], "expected /json/pointer="), (["--vary", "/a="], "values between the commas"),
                            (["--vary", "/a=1", "--vary", "/a=2"], "a key twice")):
            self.assertIn(text, sweep(SCENE, "-o", self.folder, *words, status=2).stderr)
        self.assertIn("no such file", sweep("nowhere.json", "--vary", "/a=1", status=2).stderr)
        self.assertIn("no sweep.json", sweep("--collect", self.temporary.name, status=2).stderr)
        self.assertFalse(self.folder.exists())


if __name__ == "__main__":
    unittest.main()
