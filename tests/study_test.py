#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""`itr study` on Cook's membrane, small. Arguments: the command, the folder of examples."""
import csv
import itertools
import json
import os
import pathlib
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import unittest
import xml.etree.ElementTree as ElementTree

EXAMPLES = pathlib.Path(sys.argv.pop())
ITR = sys.argv.pop()
SMALL = ["--set", "/geometry/0/n_refs=1", "--set", "/time/dt=0.25", "--frames", "4"]
PATIENCE = 300  # s, for a loaded machine


def command(folder, *more, levels=2, tolerances="4000,500"):
    return [ITR, "study", EXAMPLES / "cantilever.json", "-o", folder, *SMALL, "--levels", str(levels), "--tolerances", tolerances, *more]


def study(folder, *more, status=0, **options):
    done = subprocess.run(command(folder, *more, **options), capture_output=True, text=True)
    assert done.returncode == status, done.stderr
    return done


def rows(folder):
    with open(folder / "study.csv", newline="") as file:
        return {row["run"]: row for row in csv.DictReader(file)}


def write_box(path, counts, edge):
    """Gmsh's file of a box of cubes, each of six tetrahedra."""
    n = [count + 1 for count in counts]
    number = lambda p: 1 + p[0] + n[0] * (p[1] + n[1] * p[2])
    nodes = [(i, j, k) for k in range(n[2]) for j in range(n[1]) for i in range(n[0])]
    tetrahedra = []
    for corner in itertools.product(*map(range, counts)):
        for order in itertools.permutations(range(3)):
            places = [list(corner)]
            for axis in order:
                places.append([c + (k == axis) for k, c in enumerate(places[-1])])
            even = order in ((0, 1, 2), (1, 2, 0), (2, 0, 1))
            tetrahedra.append([number(p) for p in (places if even else [places[1], places[0], *places[2:]])])
    lines = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat", "$Nodes", str(len(nodes))]
    lines += [" ".join(map(str, (number(p), *(edge * c for c in p)))) for p in nodes]
    lines += ["$EndNodes", "$Elements", str(len(tetrahedra))]
    lines += [" ".join(map(str, (i + 1, 4, 2, 1, 1, *t))) for i, t in enumerate(tetrahedra)]
    path.write_text("\n".join([*lines, "$EndElements", ""]))


def write_beam(folder, units):
    """A beam of 300 mm that its weight bends; its mesh is in millimetres. The numbers are those of `units`."""
    write_box(folder / "box.msh", [3, 1, 1], 100)
    kilogram, metre = (1, 1) if not units else (1e-3, 1e3)  # of tonnes and millimetres
    scene = {"geometry": [{"mesh": "box.msh", "unit": "mm", "surface_selection": {"threshold": 1e-3 * metre}}],
             "materials": {"type": "NeoHookean", "E": 2e5 * kilogram / metre, "nu": 0.3, "rho": 1000 * kilogram / metre**3},
             "boundary_conditions": {"rhs": [0, 9.81 * metre, 0], "dirichlet_boundary": [{"id": 1, "value": [0, 0, 0]}]},
             "time": {"dt": 0.5, "tend": 1, "quasistatic": True}, **({"units": units} if units else {})}
    path = folder / "beam.json"
    path.write_text(json.dumps(scene))
    return path


class Study(unittest.TestCase):
    def setUp(self):
        self.temporary = tempfile.TemporaryDirectory()
        self.folder = pathlib.Path(self.temporary.name)

    def tearDown(self):
        self.temporary.cleanup()

    def test_measures_ranks_and_does_nothing_twice(self):
        first = study(self.folder, "--series", "uniform,itr,solvers,time")
        found = rows(self.folder)
        for name in ("reference", "uniform-0", "uniform-2", "itr-4000", "itr-500", "solvers-eigen-ldlt", "time-1", "time-4"):
            self.assertEqual(found[name]["status"], "finished", name)
        value = lambda run, column: float(found[run][column])
        for k in range(2):  # P1: orders 2 and 1, less by the singular corners
            self.assertGreater(value(f"uniform-{k}", "l2"), 2 * value(f"uniform-{k + 1}", "l2"))
            self.assertGreater(value(f"uniform-{k}", "h1"), 1.5 * value(f"uniform-{k + 1}", "h1"))
            self.assertGreater(value(f"uniform-{k}", "energy"), 2 * value(f"uniform-{k + 1}", "energy"))
        self.assertLess(value("itr-500", "h1"), value("itr-4000", "h1"))
        self.assertLess(value("itr-4000", "h1"), value("uniform-0", "h1"))
        self.assertGreater(value("itr-500", "unknowns"), value("itr-4000", "unknowns"))
        self.assertEqual(found["reference"]["l2"], "")
        self.assertEqual(found["time-4"]["l2"], "")  # what the others of its series are compared with
        # Quasistatic and elastic: another path to the same end.
        self.assertLess(value("time-1", "h1"), 1e-2 * value("uniform-1", "h1"))
        self.assertAlmostEqual(value("solvers-eigen-ldlt", "l2"), value("uniform-1", "l2"), delta=1e-5 * value("uniform-1", "l2"))
        self.assertGreater(value("uniform-2", "processor_seconds"), 0)

        content = json.loads((self.folder / "study.json").read_text())
        verdict = next(v for v in content["verdicts"] if (v["series"], v["measure"]) == ("itr", "l2"))
        self.assertAlmostEqual(verdict["finest_uniform"]["error"], value("uniform-2", "l2"), delta=1e-5 * value("uniform-2", "l2"))
        for point in verdict["points"]:
            self.assertAlmostEqual(point["error"], value(point["run"], "l2"), delta=1e-5 * point["error"])
            self.assertTrue(point["unknowns_ratio"] is None or point["unknowns_ratio"] < 1)  # None: no uniform level has that error
        orders = {(order["series"], order["measure"]): order for order in content["orders"]}
        self.assertGreater(orders["uniform", "l2"]["in_size"], 1.3)
        self.assertTrue(any("`itr`" in sentence and "pay" in sentence for sentence in content["answers"]))
        self.assertTrue(any(sentence.startswith("Linear solvers") and "eigen:ldlt" in sentence for sentence in content["answers"]))
        self.assertTrue(any("the mesh rules" in sentence for sentence in content["answers"]), content["answers"])
        page = (self.folder / "study.md").read_text()
        self.assertIn("For this error, run this", page)
        self.assertIn(page, first.stdout)
        svg = ElementTree.parse(self.folder / "study.svg").getroot()
        lines = {f"{series}-{measure}-{cost}" for series in ("uniform", "itr") for cost in ("processor_seconds", "unknowns", "memory_mb")
                 for measure in ("l2", "h1", "surface", "energy")}  # no momentum: quasistatic
        drawn = {group.get("id", ""): group for group in svg.iter("{http://www.w3.org/2000/svg}g")}
        self.assertEqual({name for name in drawn if re.match("(uniform|itr|swaps)-", name)}, lines)
        for name, points in (("uniform-h1-unknowns", 3), ("itr-l2-memory_mb", 2)):
            self.assertEqual(len(drawn[name].findall(".//{http://www.w3.org/2000/svg}use")), points, name)

        frames = {path: path.stat().st_mtime_ns for path in self.folder.rglob("frames/*.h5")}
        before = (self.folder / "study.csv").read_text()
        study(self.folder, "--series", "uniform,itr,solvers,time")
        self.assertEqual(frames, {path: path.stat().st_mtime_ns for path in self.folder.rglob("frames/*.h5")})
        self.assertEqual(before, (self.folder / "study.csv").read_text())

    def test_says_what_its_reference_is_worth(self):
        study(self.folder, "--series", "uniform,itr", levels=1)
        content = json.loads((self.folder / "study.json").read_text())
        runs = {run["run"]: run for run in content["runs"]}
        self.assertEqual(content["worth"]["h1"], runs["second-reference"]["errors"]["h1"])
        self.assertGreater(content["worth"]["h1"], 0)
        self.assertTrue(any(doubt.startswith("The reference is worth") for doubt in content["doubts"]))
        for name in ("uniform-0", "itr-4000"):
            for measure in ("l2", "h1", "energy"):
                error = runs[name]["errors"][measure]
                self.assertTrue(error is None or error >= content["worth"][measure], (name, measure))
        # A given reference's error is not known, unless a second one is given too.
        given = self.folder / "runs/reference"
        study(self.folder / "one", "--series", "uniform", "--reference", given, levels=1)
        self.assertIn("not known", (self.folder / "one/study.md").read_text())
        study(self.folder / "two", "--series", "uniform", "--reference", given, "--second-reference",
              self.folder / "runs/second-reference", levels=1)
        worth = json.loads((self.folder / "two/study.json").read_text())["worth"]
        self.assertAlmostEqual(worth["h1"], content["worth"]["h1"], delta=1e-9)
        # A run of the study may be its reference: it is not held against itself.
        study(self.folder / "own", "--series", "uniform", levels=1)
        study(self.folder / "own", "--series", "uniform", "--reference", self.folder / "own/runs/uniform-1", levels=1)
        errors = {run["run"]: run.get("errors") for run in json.loads((self.folder / "own/study.json").read_text())["runs"]}
        self.assertIsNone(errors["uniform-1"])
        self.assertGreater(errors["uniform-0"]["h1"], 0)

    def test_a_reference_that_splits_nothing_is_refused(self):
        done = study(self.folder, "--series", "uniform", "--reference-tolerance", "1e9", levels=1, status=2)
        self.assertIn("a reference that is its uniform level: ", done.stderr)
        self.assertFalse((self.folder / "study.md").exists())
        # One that is given, too.
        given = self.folder / "given"
        subprocess.run([ITR, "run", EXAMPLES / "cantilever.json", "-o", given, "--set", "/geometry/0/n_refs=2", "--set",
                        "/time/dt=0.25", "--set", "/space/remesh/enabled=false"], check=True, capture_output=True)
        study(self.folder / "same", "--series", "uniform,itr", "--reference", given, levels=1)
        content = json.loads((self.folder / "same/study.json").read_text())
        self.assertIn("it equals the finest uniform level", content["refused"])
        self.assertEqual((content["verdicts"], content["orders"]), ([], []))
        self.assertTrue(all("errors" not in run for run in content["runs"]))
        self.assertTrue((self.folder / "same/study.md").read_text().split("- ")[1].startswith("Nothing is said of errors"))

    def test_tries_smaller_tolerances_where_the_first_splits_nothing(self):
        study(self.folder, "--series", "uniform", levels=1, tolerances="4e9,4e8")
        content = json.loads((self.folder / "study.json").read_text())
        self.assertTrue(content["reference"].startswith("`reference-"), content["reference"])
        self.assertIsNone(content["refused"])

    def test_repeats_warnings_of_its_runs(self):
        study(self.folder, "--series", "uniform", "--set", "/boundary_conditions/rhs=[0,-9.81]", levels=1)
        page = (self.folder / "study.md").read_text()
        self.assertIn("## Warnings of the runs", page)
        self.assertIn("`uniform-0`, `uniform-1`", page[page.index("## Warnings"):])
        again = page[page.index("## Warnings"):]
        study(self.folder, "--series", "uniform", "--set", "/boundary_conditions/rhs=[0,-9.81]", levels=1)
        page = (self.folder / "study.md").read_text()
        self.assertEqual(again, page[page.index("## Warnings"):])

    def test_says_what_its_levels_do_not_tell(self):
        # More accurate than the finest uniform level and dearer: who would be ahead there is not known.
        study(self.folder, "--series", "uniform,itr", levels=1, tolerances="5")
        content = json.loads((self.folder / "study.json").read_text())
        verdict = next(v for v in content["verdicts"] if (v["series"], v["measure"]) == ("itr", "energy"))
        point = verdict["points"][0]
        self.assertIsNone(point["time_ratio"])
        self.assertGreater(point["seconds"], verdict["finest_uniform"]["seconds"])
        self.assertEqual(verdict["untold_from"], point["error"])
        self.assertIsNone(verdict["pays_from"])
        sentence = next(s for s in content["answers"] if "`itr`" in s and s.startswith("error of the energy"))
        self.assertIn("a finer uniform level would tell", sentence)
        self.assertNotIn("does not pay", sentence)

    def test_goes_on_where_it_was_killed(self):
        whole, killed = self.folder / "whole", self.folder / "killed"
        study(whole, "--series", "uniform")
        running = subprocess.Popen(command(killed, "--series", "uniform"), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        log = killed / "runs/uniform-1/steps.jsonl"
        until = time.monotonic() + PATIENCE
        while not log.exists() and time.monotonic() < until and running.poll() is None:
            time.sleep(0.002)
        running.send_signal(signal.SIGKILL)
        running.wait()
        self.assertTrue(log.exists())
        self.assertFalse((killed / "study.csv").exists())
        study(killed, "--series", "uniform")
        for name, row in rows(whole).items():
            self.assertEqual([row[c] for c in ("l2", "h1", "surface", "energy", "vertices", "potential")],
                             [rows(killed)[name][c] for c in ("l2", "h1", "surface", "energy", "vertices", "potential")])

    def test_told_to_stop_it_saves_and_goes_on_later(self):
        running = subprocess.Popen(command(self.folder, "--series", "uniform"), stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
        log = self.folder / "runs/reference/steps.jsonl"
        until = time.monotonic() + PATIENCE
        while not log.exists() and time.monotonic() < until and running.poll() is None:
            time.sleep(0.002)
        running.send_signal(signal.SIGTERM)
        _, said = running.communicate(timeout=PATIENCE)
        self.assertEqual(running.returncode, 3)
        self.assertIn(b"the same command goes on from there", said)
        study(self.folder, "--series", "uniform")
        self.assertEqual(rows(self.folder)["uniform-2"]["status"], "finished")

    def test_says_what_failed_and_goes_on_without_it(self):
        # Not with remeshing: the reference cannot run, and the finest uniform level takes its place.
        study(self.folder, "--series", "uniform,itr", "--set", '/materials/0/rho="1 + x"')
        found = rows(self.folder)
        for name in ("reference", "itr-500"):
            self.assertEqual(found[name]["status"], "failed")
            self.assertIn("a density that varies in space", found[name]["reason"])
        self.assertEqual(found["uniform-2"]["l2"], "")
        self.assertGreater(float(found["uniform-0"]["l2"]), float(found["uniform-1"]["l2"]))
        page = (self.folder / "study.md").read_text()
        self.assertIn("Errors against `uniform-2`", page)
        self.assertIn("Failed: reference:", page)

    def test_a_run_that_takes_too_long_is_ended(self):
        subprocess.run(command(self.folder, "--series", "uniform", "--time-limit", "0.05", "--set", "/geometry/0/n_refs=4"),
                       capture_output=True)  # whatever else finishes in time, the reference does not
        self.assertEqual(rows(self.folder)["reference"]["reason"], "took longer than 0.05 s")

    def test_quadratic_elements_beside_linear_ones(self):
        study(self.folder, "--series", "uniform,uniform-p2", tolerances="30")
        found = rows(self.folder)
        value = lambda run, column: float(found[run][column])
        self.assertNotIn("uniform-p2-2", found)
        for k in range(2):  # as many unknowns as the next level's, a part of the error
            self.assertAlmostEqual(value(f"uniform-p2-{k}", "unknowns"), value(f"uniform-{k + 1}", "unknowns"),
                                   delta=0.05 * value(f"uniform-{k + 1}", "unknowns"))
            for measure in ("l2", "h1", "energy"):
                self.assertLess(value(f"uniform-p2-{k}", measure), 0.6 * value(f"uniform-{k + 1}", measure), (k, measure))
        content = json.loads((self.folder / "study.json").read_text())
        verdict = next(v for v in content["verdicts"] if (v["series"], v["measure"]) == ("uniform-p2", "h1"))
        self.assertTrue(all(point["unknowns_ratio"] is None or point["unknowns_ratio"] < 1 for point in verdict["points"]))
        self.assertIn('id="uniform-p2-h1-unknowns"', (self.folder / "study.svg").read_text())

    def test_a_given_reference(self):
        reference = self.folder / "given"
        subprocess.run([ITR, "run", EXAMPLES / "cantilever.json", "-o", reference, "--set", "/geometry/0/n_refs=2", "--set",
                        "/time/dt=0.25", "--set", "/space/remesh/enabled=false"], check=True, capture_output=True)
        study(self.folder / "study", "--series", "uniform", "--reference", reference)
        found = rows(self.folder / "study")
        self.assertNotIn("reference", found)
        self.assertEqual(float(found["uniform-1"]["l2"]), 0)
        self.assertGreater(float(found["uniform-2"]["l2"]), 1e-3)

    def test_series_say_what_they_do_of_scenes_with_curved_edges(self):
        study(self.folder, "--series", "itr,hp,p,sizing-field", "--set", "/space/remesh/curve/enabled=true", levels=1, tolerances="2000")
        tried = lambda run: sum(json.loads(line)[kind]["tried"] for kind in ("curves", "straightens")
                                for line in (self.folder / "runs" / run / "steps.jsonl").read_text().splitlines())
        for name, row in rows(self.folder).items():
            self.assertEqual(row["status"], "finished", f"{name}: {row['reason']}")
            if "reference" not in name:
                self.assertEqual(tried(name) > 0, name.split("-")[0] in ("hp", "p"), name)

    def test_rows_of_a_mesh_in_millimetres(self):
        scene = write_beam(self.folder, {})
        done = subprocess.run([ITR, "study", scene, "-o", self.folder / "study", "--series", "uniform,rows", "--levels", "1",
                               "--tolerances", "1e-4", "--frames", "2"], capture_output=True, text=True)
        self.assertEqual(done.returncode, 0, done.stderr)
        found = rows(self.folder / "study")
        self.assertEqual(found["rows-1"]["status"], "finished", found["rows-1"]["reason"])
        self.assertLess(float(found["rows-1"]["l2"]), 1)

    def test_a_given_reference_in_units_of_its_own(self):
        scene = write_beam(self.folder, {"length": "mm", "mass": "t"})
        errors = {}
        for units in ("scene", "SI"):
            reference = self.folder / units
            subprocess.run([ITR, "run", scene, "-o", reference, "--set", "/geometry/0/n_refs=2", "--set", f'/output/units="{units}"'],
                           check=True, capture_output=True)
            done = subprocess.run([ITR, "study", scene, "-o", self.folder / "study", "--series", "uniform", "--levels", "1",
                                   "--reference", reference, "--frames", "2"], capture_output=True, text=True)
            self.assertEqual(done.returncode, 0, done.stderr)
            errors[units] = {run: {c: float(row[c]) for c in ("l2", "h1", "surface", "energy")}
                             for run, row in rows(self.folder / "study").items()}
        self.assertGreater(errors["SI"]["uniform-0"]["l2"], 0.01)
        for run, values in errors["SI"].items():
            for column, value in values.items():
                self.assertAlmostEqual(errors["scene"][run][column], value, delta=1e-4 * value, msg=(run, column))

    def test_a_given_reference_without_kinetic_energy(self):
        scene, reference = write_beam(self.folder, {}), self.folder / "reference"
        dynamic = ["--set", "/time/quasistatic=false"]
        subprocess.run([ITR, "run", scene, "-o", reference, "--set", "/geometry/0/n_refs=2", *dynamic], check=True, capture_output=True)
        for _ in range(2):  # measured, and kept
            done = subprocess.run([ITR, "study", scene, "-o", self.folder / "study", "--series", "uniform", "--levels", "1", *dynamic,
                                   "--reference", reference, "--frames", "2"], capture_output=True, text=True)
            self.assertEqual(done.returncode, 0, done.stderr)
            row = rows(self.folder / "study")["uniform-0"]
            self.assertGreater(float(row["l2"]), 0)
            self.assertEqual((row["energy"], row["momentum"]), ("", ""))
            self.assertIn("of the energy no errors are told", done.stdout)
            self.assertIn("of the momentum no errors are told", done.stdout)

    def test_a_given_reference_without_momentum_alone(self):
        scene, reference = write_beam(self.folder, {}), self.folder / "reference"
        dynamic = ["--set", "/time/quasistatic=false"]
        subprocess.run([ITR, "run", scene, "-o", reference, "--set", "/geometry/0/n_refs=2", "--set",
                        "/output/paraview/options/kinetic_energy=true", *dynamic], check=True, capture_output=True)
        done = subprocess.run([ITR, "study", scene, "-o", self.folder / "study", "--series", "uniform", "--levels", "1", *dynamic,
                               "--reference", reference, "--frames", "2"], capture_output=True, text=True)
        self.assertEqual(done.returncode, 0, done.stderr)
        row = rows(self.folder / "study")["uniform-0"]
        self.assertGreater(float(row["energy"]), 0)
        self.assertEqual(row["momentum"], "")
        self.assertIn("of the momentum no errors are told", done.stdout)
        self.assertNotIn("of the energy no errors are told", done.stdout)

    def test_references_of_curved_series_are_quadratic(self):
        study(self.folder, "--series", "uniform,uniform-p2,hp,hp-smoothing", levels=1, tolerances="2000")
        found = rows(self.folder)
        value = lambda run, column: float(found[run][column])
        self.assertIn("hp-smoothing-2000", found)
        # Its space has that of the finest quadratic level, and is never coarsened.
        self.assertLess(value("reference", "potential"), value("uniform-p2-0", "potential"))
        self.assertGreater(value("reference", "unknowns"), value("uniform-p2-0", "unknowns"))
        summary = json.loads((self.folder / "runs/reference/summary.json").read_text())
        self.assertEqual([summary[kind]["accepted"] for kind in ("collapses", "straightens")], [0, 0])

    def test_its_program_may_be_replaced_meanwhile(self):
        prefix = self.folder / "prefix"
        (prefix / "bin").mkdir(parents=True)
        for name in ("lib", "share"):
            (prefix / name).symlink_to(pathlib.Path(ITR).resolve().parent.parent / name)
        copied = prefix / "bin/itr"
        shutil.copy(ITR, copied)
        solvers = subprocess.run([copied, "solvers"], capture_output=True, text=True).stdout
        solver = next((name for name in ("cholmod", "umfpack", "mumps") if re.search(rf"^{name} .*self-test residual", solvers, re.M)), None)
        if solver is None:
            self.skipTest("no solver module")
        words = [copied, *command(self.folder / "study", "--series", "uniform", "--solver", solver, levels=1)[1:]]
        running = subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        for line in running.stderr:
            if line.startswith("[1/"):
                copied.unlink()
                break
        running.communicate()
        for name, row in rows(self.folder / "study").items():
            self.assertEqual(row["status"], "finished", f"{name}: {row['reason']}")

    def test_names_of_series_are_checked(self):
        done = study(self.folder, "--series", "uniform,nothing", status=2)
        self.assertIn('--series: found "nothing"', done.stderr)
        self.assertIn("sizing-field", done.stderr)

    def test_wrong_input_is_named_before_anything_runs(self):
        for words in (["--levels", "0"], ["--tolerances", "1,-1"], ["--time-limit", "-1"], ["--starts", "x"], ["--nothing"],
                      ["--set", "n_refs=1"], ["--set", "/geometry/0/n_ref=1"]):
            done = study(self.folder, "--series", "uniform", *words, status=2)
            self.assertIn(words[1].partition("=")[0] if words[0] == "--set" else words[0], done.stderr, words)
            self.assertFalse((self.folder / "runs").exists(), words)

    def test_what_is_missing_is_said_in_one_line(self):
        python = self.folder / "python"
        python.write_text('#!/bin/sh\nexec /usr/bin/python3 -S "$@"\n')  # without the packages of the system
        python.chmod(0o755)
        for path, package in ((python, "python3-matplotlib"), (self.folder / "nothing", "python3 python3-matplotlib")):
            done = subprocess.run(command(self.folder / "study"), capture_output=True, text=True, env=os.environ | {"ITR_PYTHON": path})
            self.assertEqual(done.returncode, 2)
            self.assertTrue(done.stderr.endswith(f"apt install {package}\n"), done.stderr)
            self.assertEqual(done.stderr.count("\n"), 1)
            self.assertFalse((self.folder / "study").exists())
        said = subprocess.run([ITR, "study", "--help"], capture_output=True, text=True, check=True, env=os.environ | {"ITR_PYTHON": python})
        self.assertIn("sizing-field (not by default)", said.stdout)


if __name__ == "__main__":
    unittest.main()
