#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Answers of a study to rows made up for it, when it has to say nothing, and the runs that it plans. Arguments: the command, the
source folder."""
import json
import math
import pathlib
import subprocess
import sys
import tempfile
import unittest
from collections import Counter
from dataclasses import replace
from types import SimpleNamespace

SOURCE = pathlib.Path(sys.argv.pop())
ITR = sys.argv.pop()
sys.path.insert(0, str(SOURCE / "src/apps/study"))
sys.dont_write_bytecode = True

import answers  # noqa: E402
import plan  # noqa: E402
import plot  # noqa: E402
import report  # noqa: E402
from results import ENERGY, H1, Row, read_warnings  # noqa: E402


def row(series, name, error, seconds, unknowns=100):
    """A run with the same relative error in L2 and H1, and ten times it in J, of a reference of 10 J."""
    errors = {"l2": error, "h1": error, "surface": 0, "energy": 10 * error, "momentum": 0, "reference_energy": 10}
    run = plan.Run(name, plan.ALL_SERIES[series], "", {})
    return Row(run, certified=True, unknowns=unknowns, processor_seconds=seconds, memory_mb=10, errors=errors)


def study_of(*rows):
    worth = dict.fromkeys(("l2", "h1", "surface", "energy", "momentum"), 0)
    return answers.Answers("scene.json", reference="`reference`", worth=worth, second_reference="`second-reference`", rows=list(rows))


def uniform_and(*rows):
    return study_of(row("uniform", "uniform-0", 0.4, 1), row("uniform", "uniform-1", 0.2, 10, 400),
                    row("uniform", "uniform-2", 0.1, 100, 1600), *rows)


def verdict_of(results, series, measure="h1"):
    return next(v for v in replace(results).verdicts if (v["series"], v["measure"]) == (series, measure))


def chosen(results, measure="h1"):
    """Runs to take, by error."""
    return {round(error, 12): point.row.run.name for of, error, point, _ in replace(results).choices() if of.name == measure}


class Answers(unittest.TestCase):
    def assert_doubted(self, results, *parts):
        doubts = list(replace(results).doubts())
        self.assertTrue(any(all(part in doubt for part in parts) for doubt in doubts), (parts, doubts))

    def test_no_error_is_told_below_the_reference_s_own(self):
        results = uniform_and(row("itr", "itr-1", 0.15, 2), row("itr", "itr-0.1", 0.05, 4))
        self.assertEqual(len(verdict_of(results, "itr")["points"]), 2)
        results.worth.update(l2=0.08, h1=0.08, energy=0.8)
        self.assertEqual(len(verdict_of(results, "itr")["points"]), 1)
        self.assertIsNone(results.told_error(results.rows[-1], H1))
        self.assertIn("below 0.08", report.make_page(replace(results)))
        self.assert_doubted(results, "8 % (l2)", "8 % (h1)", "0.8 J (energy)")
        last = report.make_csv(results).splitlines()[-1].split(",")
        self.assertEqual((last[:4], last[-5:]), (["itr-0.1", "itr", "", "finished"], ["", "", "0", "", "0"]))
        results.worth = None
        self.assert_doubted(results, "not known", "--second-reference")

    def test_nothing_pays_of_errors_beyond_half(self):
        # Ten times faster than a uniform mesh that is as wrong.
        results = uniform_and(row("uniform", "uniform-x", 0.9, 0.5), row("itr", "itr-4", 0.8, 0.05), row("itr", "itr-1", 0.3, 20))
        verdict = verdict_of(results, "itr")
        self.assertEqual([point["is_large"] for point in verdict["points"]], [True, False])
        self.assertLess(verdict["points"][0]["time_ratio"], 1)
        self.assertIsNone(verdict["pays_from"])
        self.assert_doubted(results, "H1", "`uniform-x`, `itr-4`", "50 %")
        self.assertNotIn("itr-4", chosen(results).values())

    def test_energies_are_related_to_the_reference(self):
        results = uniform_and(row("itr", "itr-1", 0.3, 0.1))
        self.assertFalse(verdict_of(results, "itr", "energy")["points"][0]["is_large"])
        for one in results.rows:
            one.errors["reference_energy"] = 5
        self.assertTrue(verdict_of(results, "itr", "energy")["points"][0]["is_large"])

    def test_tolerances_that_others_beat_are_shown(self):
        results = uniform_and(row("itr", "itr-4", 0.3, 50), row("itr", "itr-1", 0.15, 5))
        verdict = verdict_of(results, "itr")
        self.assertEqual([point["beaten_by"] for point in verdict["points"]], ["itr-1", None])
        self.assertGreater(verdict["points"][0]["time_ratio"], 1)
        self.assertEqual(verdict["pays_from"], 0.15)  # not from 0.3 on: that run takes longer
        self.assertIn("`itr-4` by `itr-1`", answers.in_words(verdict, H1))

    def test_the_table_recommends_what_the_verdict_does(self):
        # itr-1 is the cheapest run below 0.2, but a uniform mesh between the levels would take less than it: it does not pay.
        results = uniform_and(row("itr", "itr-1", 0.19, 15))
        self.assertGreater(verdict_of(results, "itr")["points"][0]["time_ratio"], 1)
        self.assertIsNone(verdict_of(results, "itr")["pays_from"])
        self.assertEqual(chosen(results), {0.2: "uniform-1", 0.1: "uniform-2"})
        # Nor where it is more accurate than asked, and uniform refinement has what is asked for less.
        results = uniform_and(row("itr", "itr-1", 0.11, 30))
        self.assertEqual(verdict_of(results, "itr")["pays_from"], 0.11)
        self.assertEqual(chosen(results)[0.2], "uniform-1")
        # Where only remeshing reaches an error, it is what there is.
        self.assertEqual(chosen(uniform_and(row("itr", "itr-1", 0.05, 30)))[0.05], "itr-1")

    def test_runs_below_the_reference_s_own_error_reach_it(self):
        # uniform-2's error is not told, but it is no larger than 0.12: a run that takes longer for 0.12 is not recommended.
        results = uniform_and(row("itr", "itr-1", 0.121, 200))
        results.worth["h1"] = 0.12
        self.assertEqual(len(results.points(("uniform",), H1)), 2)
        self.assertEqual(results.points(("uniform",), H1, reached=True)[-1].error, 0.12)
        self.assertGreater(verdict_of(results, "itr")["points"][0]["time_ratio"], 1.9)
        self.assertEqual(chosen(results), {0.2: "uniform-1"})

    def test_a_run_may_be_nearer_to_the_limit_than_the_reference(self):
        results = uniform_and(row("uniform-p2", "uniform-p2-2", 0.05, 20), row("uniform", "reference", 0, 1))
        results.reference_run = "reference"
        results.rows[-1].run.reference, results.rows[-1].potential, results.rows[-2].potential = "", -10, -12
        self.assert_doubted(results, "`uniform-p2-2`", "potential", "by 2 J")
        results.has_friction = True
        self.assertFalse(any("potential" in doubt for doubt in replace(results).doubts()))

    def test_the_better_of_levels_and_rows_judges(self):
        results = uniform_and(row("itr", "itr-1", 0.2, 5))
        self.assertAlmostEqual(verdict_of(results, "itr")["points"][0]["time_ratio"], 0.5, delta=1e-12)
        results.rows.append(row("rows", "rows-1", 0.2, 2.5))
        self.assertAlmostEqual(verdict_of(results, "itr")["points"][0]["time_ratio"], 2, delta=1e-12)
        self.assertEqual(chosen(results)[0.2], "rows-1")

    def test_quadratic_elements_are_judged_by_linear_ones_and_remeshing_by_both(self):
        results = uniform_and(row("itr", "itr-1", 0.2, 5), row("uniform-p2", "uniform-p2-0", 0.2, 2),
                              row("uniform-p2", "uniform-p2-1", 0.02, 20))
        quadratic, remeshed = verdict_of(results, "uniform-p2"), verdict_of(results, "itr")
        self.assertAlmostEqual(quadratic["points"][0]["time_ratio"], 0.2, delta=1e-12)
        self.assertIsNone(quadratic["points"][1]["time_ratio"])  # linear elements have not come to it
        self.assertEqual(quadratic["pays_from"], 0.2)
        self.assertAlmostEqual(remeshed["points"][0]["time_ratio"], 0.5, delta=1e-12)
        self.assertAlmostEqual(remeshed["points"][0]["quadratic_ratio"], 2.5, delta=1e-12)
        self.assertIsNone(remeshed["pays_from"])
        self.assertIn("2.5 of the time that it takes with quadratic elements", answers.in_words(remeshed, H1))
        self.assertEqual((chosen(results)[0.2], chosen(results)[0.02]), ("uniform-p2-0", "uniform-p2-1"))
        self.assertNotIn("itr-1", chosen(results).values())
        self.assertIn('id="uniform-p2-h1-processor_seconds"', plot.make_svg(results))

    def test_nothing_is_recommended_where_no_run_is_near_the_reference(self):
        results = study_of(row("uniform", "uniform-0", 1.2, 1), row("uniform", "uniform-1", 0.9, 10), row("itr", "itr-1", 0.8, 2),
                           row("itr", "itr-0.1", 0.7, 3))
        self.assert_doubted(results, "H1", "70 %", "nothing is recommended")
        self.assertEqual((chosen(results), list(replace(results).answers())), ({}, []))
        self.assertFalse(verdict_of(results, "itr")["is_recommended"])

    def test_nothing_is_recommended_of_impossible_orders(self):
        # Four times the unknowns and a hundredth of the error: order 6.6 in 2D.
        results = study_of(row("uniform", "uniform-0", 0.4, 1), row("uniform", "uniform-1", 0.004, 10, 400),
                           row("uniform", "uniform-2", 4e-5, 100, 1600), row("itr", "itr-1", 0.2, 0.1))
        order = next(o for o in results.orders if (o["series"], o["measure"]) == ("uniform", "h1"))
        self.assertAlmostEqual(order["in_size"], 2 * math.log(100) / math.log(4), delta=1e-12)
        self.assert_doubted(results, "`uniform`", "order of 6.6")
        self.assertEqual(chosen(results), {})
        results = uniform_and(row("itr", "itr-4", 0.4, 0.1), row("itr", "itr-1", 0.004, 0.2, 200), row("itr", "itr-0.1", 4e-5, 0.3, 400))
        self.assertFalse(verdict_of(results, "itr")["is_recommended"])
        self.assertEqual(set(chosen(results).values()), {"uniform-1", "uniform-2"})

    def test_runs_in_which_a_body_flies_are_left_out(self):
        results = uniform_and(row("itr", "itr-1", 0.15, 2), row("itr", "itr-0.1", 0.12, 3))
        results.rows[-1].flight = 3.6
        self.assertEqual(len(verdict_of(results, "itr")["points"]), 1)
        self.assertIn("by up to 3.6 times the size of the scene, in `itr-0.1`", next(replace(results).doubts()))
        results.is_dynamic = True  # a body in motion may
        self.assertEqual(len(verdict_of(results, "itr")["points"]), 2)

    def test_a_refused_reference_is_said_first(self):
        results = uniform_and(row("itr", "itr-1", 0.15, 2))
        results.refused = "it equals the finest uniform level, `uniform-2`"
        for one in results.rows:
            one.errors = None
        self.assertIn(results.refused, report.make_page(replace(results)).split("\n- ")[1])
        self.assertEqual((results.verdicts, chosen(results)), ([], {}))

    def test_warnings_of_runs_are_repeated(self):
        log = ["step 1/3", "warning: dhat is large", *(f"warning: step {k}: friction is off" for k in (2, 5, 7))]
        log += ["going on after step 5", "warning: dhat is large", "warning: step 7: friction is off"]
        self.assertEqual(read_warnings("\n".join(log)), {"dhat is large": 1, "friction is off": 3})
        results = uniform_and()
        results.rows[0].warnings = Counter({"dhat is large": 1})
        results.rows[1].warnings = Counter({"dhat is large": 1, "friction is off": 7})
        self.assert_doubted(results, "2 of 3 runs gave warnings")
        self.assertIn("- dhat is large: `uniform-0`, `uniform-1`\n- friction is off: `uniform-1` (7 times)\n", report.make_page(replace(results)))

    def test_the_mesh_or_the_time_step_rules(self):
        for error, ruling in ((0.5, "the time step rules"), (0.05, "the mesh rules")):
            results = uniform_and(row("time", "time-1", error, 1), row("time", "time-2", error / 2, 2))
            for one in results.rows[3:]:
                one.run.reference = "time-4"
            self.assertIn(ruling, next(results.time_step_answers(ENERGY)))

    def test_failed_runs_are_named_with_their_reasons(self):
        results = uniform_and(Row(plan.Run("itr-1", plan.ALL_SERIES["itr"], "", {}), reason="took | longer"))
        self.assertEqual(list(replace(results).answers())[-1], "Failed: itr-1: took | longer.")
        self.assertIn("| itr-1 |  | failed: took \\| longer |", report.make_page(replace(results)))
        self.assertEqual(json.loads(report.make_json(results))["runs"][-1]["status"], "failed")


class Plans(unittest.TestCase):
    def setUp(self):
        self.temporary = tempfile.TemporaryDirectory()
        self.addCleanup(self.temporary.cleanup)
        self.options = SimpleNamespace(output=pathlib.Path(self.temporary.name), series=[], levels=None, tolerances=None, starts=[0],
                                       reference=None, reference_tolerance=None, frames=10, solver="",
                                       sets={"/contact/friction_coefficient": "0.3"})

    def plan(self, scene="cubes"):
        sets = [word for key, value in self.options.sets.items() for word in ("--set", f"{key}={value}")]
        said = subprocess.run([ITR, "explain", SOURCE / f"examples/{scene}.json", "--json", *sets], check=True, capture_output=True)
        return plan.Plan(self.options, json.loads(said.stdout))

    def settings(self, key):
        """Values of a key by run."""
        made = self.plan()
        return {run.name: run.settings.get(key) for run in made.references + made.runs}

    def test_friction_is_lagged_alike_in_all_runs(self):
        rounds = "/solver/contact/friction_iterations"
        self.assertEqual(set(self.settings(rounds).values()), {"50"})
        self.assertEqual(set(self.settings("/solver/contact/friction_convergence_tol").values()), {"0"})
        self.assertIn("at most 50 rounds", self.plan().notes)
        self.options.sets[rounds] = "3"
        self.assertEqual(set(self.settings(rounds).values()), {"3"})
        self.assertIn("at most 3 rounds", self.plan().notes)
        self.options.sets = {"/contact/friction_coefficient": "0"}
        self.assertEqual(set(self.settings(rounds).values()), {None})

    def test_all_runs_have_one_barrier(self):
        keys = "/solver/contact/barrier_stiffness", "/contact/dhat"
        for key in keys:
            self.assertEqual(set(self.settings(key).values()), {None})  # the scene has it
        self.options.sets = {keys[1]: '"auto"'}
        made = self.plan("first")
        for key in keys:
            [value] = {run.settings[key] for run in made.references + made.runs}
            self.assertEqual(float(value), made.facts["settings"][key])

    def test_there_is_a_second_reference_and_there_are_smaller_tolerances_for_the_first(self):
        self.options.tolerances = [1, 0.25]
        made, key = self.plan(), plan.TOLERANCE.format("split")
        self.assertEqual([float(run.settings[key]) for run in made.references], [2**-6, 2**-10, 2**-14])
        self.assertEqual(made.references[0].name, "reference")
        second = next(run for run in made.runs if run.name == plan.SECOND_REFERENCE)
        self.assertEqual((second.reference, float(second.settings[key])), (plan.REFERENCE, 2**-4))
        levels = [int(run.settings["/geometry/0/n_refs"]) for run in (second, made.references[0])]
        self.assertEqual(levels[0] + 1, levels[1])
        self.options.reference_tolerance = 0.01
        self.assertEqual(len(self.plan().references), 1)

    def test_quadratic_elements_are_beside_linear_ones(self):
        order = "/space/discr_order"
        quadratic = {"uniform-p2-0": "2", "uniform-p2-1": "2"}
        self.assertEqual({name: value for name, value in self.settings(order).items() if value}, quadratic)
        # The linear series of a scene of quadratic elements are linear all the same.
        self.options.sets[order] = "2"
        for name, value in self.settings(order).items():
            self.assertEqual(value, quadratic.get(name, "1"), name)

    def test_tolerances_of_operations_follow_that_of_splits(self):
        self.options.tolerances = [8]
        own = self.plan().facts["settings"]
        run = next(run for run in self.plan().runs if run.name == "smoothing-8")
        for operation in ("split", "collapse", "swap", "smooth"):
            key = plan.TOLERANCE.format(operation)
            self.assertAlmostEqual(float(run.settings[key]), 8 * own[key] / own[plan.TOLERANCE.format("split")], delta=1e-12)
        self.assertNotIn(plan.TOLERANCE.format("curve"), run.settings)

    def test_rows_fill_a_box_with_as_many_cells(self):
        path = self.options.output / "rows.msh"
        self.assertEqual(plan.write_rows([0, 0, 0], [2, 1, 1], 12 * 64, 1, path), [8, 4, 4])
        self.assertEqual(plan.write_rows([0, 0, 0], [2, 1, 1], 12 * 8, 3, path), [4, 2, 2])
        scene = {"geometry": {"mesh": str(path)}, "materials": {"id": 3, "type": "NeoHookean", "E": 1e5, "nu": 0.3, "rho": 1000}}
        (self.options.output / "rows.json").write_text(json.dumps(scene))
        said = subprocess.run([ITR, "explain", self.options.output / "rows.json", "--json"], check=True, capture_output=True)
        facts = json.loads(said.stdout)
        self.assertEqual((facts["cells"], facts["bodies"], facts["box"]), (96, [3], [[0, 0, 0], [2, 1, 1]]))


if __name__ == "__main__":
    unittest.main()
