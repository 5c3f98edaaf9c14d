#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Runs with "dt": "auto": where steps and rows end, what steps.jsonl tells, and the same bits after --resume.
Arguments: the command, the source folder."""
import csv
import json
import pathlib
import shutil
import subprocess
import sys
import tempfile
import unittest

SOURCE = pathlib.Path(sys.argv.pop())
ITR = sys.argv.pop()


class Runs(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = pathlib.Path(cls.enterClassContext(tempfile.TemporaryDirectory()))

    def run_drop(self, name, time, more=(), flags=(), status=0):
        """A tilted square falls on a line."""
        time = {"dt": "auto", "tend": 0.25, "integrator": "BDF2", "tolerance": 0.2, **time}
        time = {key: value for key, value in time.items() if value is not None}
        sets = [f"/time={json.dumps(time)}", '/output/forces=[{"name": "square", "bodies": 1}]', *more]
        words = [ITR, "run", str(SOURCE / "examples/tasks/drop.json"), "-o", str(self.folder / name), "--threads", "1", *flags]
        for text in sets:
            words += ["--set", text]
        done = subprocess.run(words, capture_output=True, text=True)
        self.assertEqual(done.returncode, status, done.stderr)
        return done

    def lines(self, name):
        return [json.loads(line) for line in (self.folder / name / "steps.jsonl").read_text().splitlines()]

    def rows(self, name):
        with open(self.folder / name / "forces.csv", newline="") as file:
            return list(csv.DictReader(file))

    def test_frames_and_rows_are_at_the_asked_times(self):
        said = self.run_drop("asked", {"output_dt": 0.04}, ["/boundary_conditions/rhs=[0, \"9.81 * if(t - 0.05, 1, 1.1)\"]"])
        times = [0, 0.04, 0.08, 0.12, 0.16, 0.2, 0.24, 0.25]
        lines = self.lines("asked")
        found = [float(row["t"]) for row in self.rows("asked")]
        self.assertEqual(len(found), len(times))
        for t, expected in zip(found, times):
            self.assertAlmostEqual(t, expected, 12)
        frames = sorted(int(path.stem) for path in (self.folder / "asked/frames").glob("*.h5"))
        self.assertEqual(frames, sorted({int(row["step"]) for row in self.rows("asked")}))
        self.assertGreater(len(lines), len(times), "steps between them have lines")
        self.assertTrue(any(line["t"] == 0.05 for line in lines), "a step ends where the load jumps")
        self.assertEqual(subprocess.run([ITR, "certify", str(self.folder / "asked")], capture_output=True).returncode, 0)

        # Every trial is told: what steps have and what the summary has is the same.
        rejected = sum(line.get("rejected_steps", 0) for line in lines)
        self.assertGreater(rejected, 0)
        self.assertEqual(rejected, sum(len(line.get("rejections", [])) for line in lines))
        for line in lines[1:]:
            for trial in line.get("rejections", []):
                self.assertGreater(trial["dt"], line["dt"])
                self.assertIn(trial["reason"], ("error in time", "impact"))
                self.assertGreater(trial["error"], 0)
        self.assertAlmostEqual(sum(line.get("dt", 0) for line in lines), 0.25, 9)
        summary = json.loads((self.folder / "asked/summary.json").read_text())
        self.assertEqual(summary["rejected_steps"], rejected)
        self.assertAlmostEqual(summary["time_error"], sum(line.get("time_error", 0) for line in lines), 9)
        self.assertIn(f"{len(lines) - 1} taken, {rejected} rejected", said.stdout)

    def test_resumed_runs_have_the_same_bits(self):
        self.run_drop("whole", {}, ["/output/checkpoint_period=0"])
        shutil.copytree(self.folder / "whole", self.folder / "cut")
        frames = sorted((self.folder / "cut/frames").glob("*.h5"))
        for path in frames[len(frames) // 2:]:
            path.unlink()
        self.run_drop("cut", {}, ["/output/checkpoint_period=0"], ["--resume"])

        def results(name):
            lines = self.lines(name)
            for line in lines:
                for key in ("seconds", "processor_seconds", "peak_rss_mb", "trial_seconds"):
                    line.pop(key, None)
            return lines, self.rows(name)

        self.assertEqual(results("whole"), results("cut"))
        self.assertGreater(len(frames), 20)

    def test_free_fall_has_its_height_with_each_integrator(self):
        """No spring tells the error of a body that falls: the work of its weight does."""
        for integrator in ("ImplicitEuler", "ImplicitNewmark", "BDF2"):
            self.run_drop(integrator, {"tend": 0.1, "integrator": integrator, "tolerance": 0.1})
            fallen = json.loads((self.folder / integrator / "summary.json").read_text())["norms"]["linf"]
            self.assertAlmostEqual(fallen / (9.81 / 2 * 0.1**2), 1, delta=0.05, msg=integrator)

    def test_what_goes_with_dt_auto_alone_is_refused_without(self):
        for key in ("tolerance", "dt_min", "dt_max", "output_dt"):
            done = self.run_drop("refused", {"dt": 0.01, "tolerance": None, key: 0.1}, status=2)
            self.assertIn(f"/time/{key}", done.stderr)


if __name__ == "__main__":
    unittest.main()
