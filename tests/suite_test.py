#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""The verification suite judges: what it must not let pass. Argument: the source folder."""
import importlib.util
import json
import math
import pathlib
import re
import sys
import tempfile
import types
import unittest

SOURCE = pathlib.Path(sys.argv.pop())
sys.path.insert(0, str(SOURCE / "verification"))
from harness import report, suite  # noqa: E402
from harness.suite import Result, excess  # noqa: E402


def run(*results):
    """The entry of a case with these results."""
    return run_case(lambda context: results)


def run_case(results):
    """The entry of a case whose results these are: a function of its context."""
    case = types.SimpleNamespace(needs=[], loader=types.SimpleNamespace(exec_module=lambda module: None), TITLE="a case",
                                 QUANTITY="x", REFERENCE="y", TOLERANCE=1, results=results)
    folder = pathlib.Path(tempfile.gettempdir())
    return suite.run_case(case, suite.Context(folder, folder, folder, folder, False, "case"))


class Cases(unittest.TestCase):
    def test_page_lists_them(self):
        section = (SOURCE / "verification/README.md").read_text().partition("\n## Cases\n")[2].partition("\n## ")[0]
        rows = [line.split("|")[1] for line in section.splitlines() if line.startswith("| `")]
        listed = [name for row in rows for name in re.findall(r"`(\w+)`", row)]
        self.assertEqual(sorted(listed), sorted(path.stem for path in (SOURCE / "verification/cases").glob("*.py")))

    def test_mixed_order_has_both_kinds_of_edges(self):
        try:
            import numpy
            from harness.scenes import is_of_mixed_order, with_edge_nodes
        except ImportError as error:
            self.skipTest(str(error))
        points, cells = numpy.array([[0.0, 0], [1, 0], [1, 1], [0, 1]]), numpy.array([[0, 1, 2], [0, 2, 3]])
        nodes, _, edges = with_edge_nodes(points, cells)
        for count in range(len(edges) + 1):
            frame = types.SimpleNamespace(rest=nodes[:len(points) + count], cells=cells, curved=edges[:count])
            self.assertEqual(is_of_mixed_order(frame), 0 < count < 5, count)


class Judgement(unittest.TestCase):
    def test_excess(self):
        self.assertEqual(excess(2, 1.5), 0.5)
        self.assertEqual(excess(1, 1.5), 0)
        for value, bound in ((math.nan, 1), (1, math.nan)):
            self.assertTrue(math.isnan(excess(value, bound)))

    def test_nan_fails(self):
        self.assertEqual(run(Result("order", excess(2, math.nan), 0.1))["status"], "failed")

    def test_results_without_a_tolerance_are_shown_and_not_counted(self):
        entry = run(Result("judged", 0.5, 1.0), Result("shown", 7.0, None))
        self.assertEqual(entry["status"], "passed")
        self.assertEqual(report.counts(entry), "1/1")
        self.assertEqual([row[-1] for row in report.rows_of(entry)[1]], ["ok", "not judged"])

    def test_a_case_that_judges_nothing_fails(self):
        self.assertEqual(run()["status"], "failed")
        self.assertEqual(run(Result("shown", 7.0, None))["status"], "failed")

    def test_a_case_without_its_data_is_skipped_unless_it_failed_before(self):
        def results(error):
            def of(context):
                yield Result("before", error, 1.0)
                yield Result("scene", 0.0, 1.0, context.data("no such scene").name)
            return of
        entry = run_case(results(0.5))
        self.assertEqual(entry["status"], "skipped")
        self.assertIn("no such scene is not there (--shared)", entry["message"])
        self.assertEqual(run_case(results(2.0))["status"], "failed")


class Bars(unittest.TestCase):
    ROW = {"case": "a", "finished": True, "certified": True, "gain": 10.0, "energy_total": -100.0, "vertices": 50,
           "processor_seconds_per_step": 6.0}

    def missed(self, bars, **changes):
        spec = importlib.util.spec_from_file_location("paper_run", SOURCE / "verification/paper/run.py")
        paper = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(paper)
        paper.BARS = {"a": bars}
        return len(paper.misses({**self.ROW, **changes}, {"a": self.ROW, "b": {"processor_seconds_per_step": 2.0}}))

    def test_each_bar_can_be_missed(self):
        met = {"gain": 10, "energy": -100, "vertices": 50, "seconds": ("b", 3)}
        self.assertEqual(self.missed(met), 0)
        for key, bar in (("gain", 10.1), ("energy", -100.1), ("energy", (-100.1, 1e-4)), ("energy", (-99.9, 1e-4)),
                         ("vertices", 49), ("seconds", ("b", 2.9))):
            self.assertEqual(self.missed({**met, key: bar}), 1, (key, bar))
        self.assertEqual(self.missed({**met, "energy": (-100.001, 1e-4)}), 0)
        for changes in ({"finished": False}, {"certified": False}, {"energy_total": math.nan},
                        {"processor_seconds_per_step": math.nan}):
            self.assertEqual(self.missed(met, **changes), 1, changes)


def load(path):
    spec = importlib.util.spec_from_file_location(path.replace("/", "_").removesuffix(".py"), SOURCE / "verification" / path)
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # dataclasses look their module up
    spec.loader.exec_module(module)
    return module


class HardCases(unittest.TestCase):
    """Each judgement fails where its subject is broken."""

    @classmethod
    def setUpClass(cls):
        try:
            cls.stability = load("stability/run.py")
        except ImportError as error:
            raise unittest.SkipTest(str(error))

    def certified(self, script, frames=2, contact=True):
        """What the judgement makes of an `itr` that does this."""
        with tempfile.TemporaryDirectory() as name:
            folder = pathlib.Path(name)
            (folder / "bin").mkdir()
            (folder / "bin/itr").write_text("#!/bin/sh\n" + script + "\n")
            (folder / "bin/itr").chmod(0o755)
            (folder / "run/frames").mkdir(parents=True)
            for step in range(frames):
                (folder / f"run/frames/{step:06}.h5").touch()
            return self.stability.violations(folder, types.SimpleNamespace(contact=contact), folder / "run")

    def printed(self, *violations, of="surfaces"):
        found = {"frames": 2, "violations": [{"of": of, "text": text} for text in violations]}
        return f"echo '{json.dumps(found)}'" + ("; exit 4" if violations else "")

    def test_a_certificate_has_to_be_made(self):
        fine = self.printed()
        self.assertEqual(self.certified(fine), [])
        for broken in ("kill -SEGV $$", "exit 0", "exit 2", "echo 'frame 1: not readable' >&2; exit 2", fine + "; exit 4",
                       fine + "; exit 1"):
            self.assertEqual(len(self.certified(broken)), 1, broken)
        self.assertIn("saw 2 of 3 frames", self.certified(fine, frames=3)[0])
        self.assertEqual(self.certified(self.printed("frame 1: edges 3 and 4 cross")), ["frame 1: edges 3 and 4 cross"])

    def test_without_contact_only_surfaces_may_meet(self):
        for of, kept in (("surfaces", []), ("cells", ["frame 1"]), ("file", ["frame 1"])):
            self.assertEqual(self.certified(self.printed("frame 1", of=of), contact=False), kept)
            self.assertEqual(self.certified(self.printed("frame 1", of=of)), ["frame 1"])

    def states(self, **last):
        """Two frames of a block that is pulled up by its held top and gains what that puts in."""
        import numpy as np
        def state(kinetic, momentum, force, velocity):
            return self.stability.Totals(kinetic, momentum, force, abs(force).sum(), np.array([[0.0, 0.0], force]),
                                         np.array([[0.0, 0.0], velocity]), 0.0, np.zeros((0, 2)))
        first = state(0.0, np.zeros(2), np.zeros(2), np.zeros(2))
        second = state(2.0, np.array([0.0, 1.0]), np.array([0.0, 20.0]), np.array([0.0, 1.5]))  # 20 N over 0.15 m
        for key, value in last.items():
            setattr(second, key, value)
        steps = [{"energy": {"elastic": e, "contact": 0.0, "body": 0.0}} for e in (1.0, 2.0)]
        scene = types.SimpleNamespace(quasistatic=False, driven=True, dim=2, gravity=10.0, mass=1.0, dt=0.1)
        return scene, steps, [first, second]

    def test_energy_may_grow_by_the_work_of_what_moves_only(self):
        import numpy as np
        scene, steps, states = self.states()
        self.assertLess(self.stability.energy_growth(scene, steps, states), 1e-12)
        for broken in ({"kinetic": 2.2}, {"kinetic": math.nan}, {"velocity": np.array([[0.0, 0.0], [0.0, 1.4]])},
                       {"reaction": None}):
            scene, steps, states = self.states(**broken)
            self.assertFalse(self.stability.energy_growth(scene, steps, states) <= self.stability.DRIVEN_ENERGY_BAR, broken)
        scene, steps, states = self.states()
        scene.driven = False
        self.assertGreater(self.stability.energy_growth(scene, steps, states), self.stability.ENERGY_BAR)

    def test_work_of_obstacles_is_that_of_their_motion(self):
        import numpy as np
        _, _, (before, now) = self.states(touch=np.array([0.0, -4.0]), obstacles=np.array([[0.0, -0.5], [1.0, -0.5]]),
                                          reaction=None)
        before.obstacles, before.touch = np.array([[0.0, 0.0], [1.0, 0.0]]), np.zeros(2)
        self.assertAlmostEqual(self.stability.work(before, now, 0.1), 2.0)
        now.obstacles = np.array([[0.0, -0.5], [1.0, 0.0]])  # they turn: whose force it is is not known
        self.assertTrue(math.isnan(self.stability.work(before, now, 0.1)))

    def test_forces_and_momentum_have_to_balance(self):
        import numpy as np
        scene, _, states = self.states()
        self.assertLess(self.stability.balance(scene, states), 1e-12)
        for broken in ({"force": np.array([0.0, 19.0])}, {"momentum": np.array([0.1, 1.0])}):
            scene, _, states = self.states(**broken)
            self.assertGreater(self.stability.balance(scene, states), self.stability.BALANCE_BAR, broken)

    def test_a_known_failure_is_shown_and_its_passing_is_a_failure(self):
        case = load("cases/stability.py")
        verdict = lambda passed: types.SimpleNamespace(passed=passed, failures="" if passed else "energy grows")
        self.assertTrue(case.result_of("a", verdict(True), {}).passed)
        self.assertFalse(case.result_of("a", verdict(False), {}).passed)
        self.assertIsNone(case.result_of("a", verdict(False), {"a": "round-off"}).passed)
        self.assertFalse(case.result_of("a", verdict(True), {"a": "round-off"}).passed)
        known = set(self.stability.cases.KNOWN)
        self.assertTrue(known & set(case.NAMES), "the quick suite shows one of what fails")


class Report(unittest.TestCase):
    OVERVIEW = {"commit": "cccc333", "date": "2026-01-01", "never_run": ["waves"], "ages": [["verification/report/results.json: old", "aaaa111", 7],
                                                                    ["verification/hard.csv", "dddd444", 3]],
                "tables": [{"what": "hard", "title": "Hard cases", "page": "hard.md", "files": ["verification/hard.csv"], "judged": 2,
                            "passed": 1, "failures": [["sliver", "does not finish"]]}]}

    def page(self, **entries):
        return report.markdown(report.blocks(entries, self.OVERVIEW))

    def test_each_case_shows_the_commit_of_its_own_run_and_its_age(self):
        old, new = run(Result("x", 0.0, 1.0)), run(Result("x", 0.0, 1.0))
        old["versions"], new["versions"] = {"itr": "aaaa111"}, {"itr": "bbbb222", "numpy": "1.24"}
        text = self.page(old=old, new=new, older=run(Result("x", 0.0, 1.0)))
        old_row, new_row, _ = (line for line in text.splitlines() if " passed | 0 | 1 |" in line)
        self.assertIn("aaaa111 | 7 |", old_row)
        self.assertIn("bbbb222 | unknown |", new_row)
        self.assertIn("Run with itr bbbb222, numpy 1.24.", text)

    def test_the_first_page_names_all_that_failed(self):
        text = self.page(fine=run(Result("x", 0.0, 1.0)), bad=run(Result("y", 2.0, 1.0), Result("z", 0.0, 1.0)))
        first, _, rest = text.partition("## What failed")
        failed = rest[:rest.index("\n## ")]
        self.assertIn("2 cases: 2 of 3 results are within their tolerances", first)
        self.assertIn("1 of 2 rows pass", first)
        self.assertIn("never run in full: waves.", first)
        self.assertIn("| hard: Hard cases | hard.md | 1/2 **FAILED** |  |  | dddd444 | 3 |", first)
        self.assertIn("| bad | y | 2, at most 1 |", failed)
        self.assertIn("| hard | sliver | does not finish |", failed)
        self.assertNotIn("fine", failed)

    def test_the_first_table_shows_the_result_nearest_to_its_bar(self):
        text = self.page(some=run(Result("far", 0.5, 100.0), Result("near", 0.09, 0.1), Result("shown", 7.0, None)))
        self.assertIn("| 2/2 passed | 0.09 | 0.1 |", text)

    def test_the_page_has_its_pictures_in_it(self):
        with tempfile.TemporaryDirectory() as folder:
            (pathlib.Path(folder) / "x.svg").write_text("<svg/>")
            self.assertIn("base64,PHN2Zy8+", report.html_page([("image", "x.svg")], pathlib.Path(folder)))


if __name__ == "__main__":
    unittest.main()
