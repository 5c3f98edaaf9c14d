# SPDX-License-Identifier: MIT
"""The Python package: arrays in and out, steps, events, errors.

usage: PYTHONPATH=BUILD_DIR/python python_test.py SOURCE_DIR
"""

import gc
import pathlib
import sys
import threading
import unittest

import numpy as np

import itr

ROOT = pathlib.Path(sys.argv.pop(1)).resolve() if len(sys.argv) > 1 else pathlib.Path(__file__).parents[1]

OPTIONS = {
    "materials": {"type": "NeoHookean", "E": 1e5, "nu": 0.3, "rho": 1000},
    "time": {"dt": 0.01, "time_steps": 5, "integrator": "ImplicitEuler"},
    "solver": {"nonlinear": {"grad_norm": 1e-10}},
}
REMESH = {"space": {"remesh": {"enabled": True, "split": {"acceptance_tolerance": 1e-4}}}}


def block(n=3, size=0.2):
    vertices = np.array([(i, j) for j in range(n + 1) for i in range(n + 1)]) * (size / n)
    a = np.array([j * (n + 1) + i for j in range(n) for i in range(n)])
    return vertices, np.concatenate([np.stack([a, a + 1, a + n + 2], 1), np.stack([a, a + n + 2, a + n + 1], 1)])


def make_model(options=OPTIONS, **more):
    model = itr.Model(*block())
    model.add_boundary("left", box=([0, 0], [0, 1]))
    model.add_boundary("right", where=lambda X: X[0] > 0.2 - 1e-9)
    model.set_options(options)
    model.set_options(more)
    return model


def make_simulation(**more):
    return itr.Simulation(make_model(**more))


class Arrays(unittest.TestCase):
    def test_views_are_shared_read_only_and_outlive_the_simulation(self):
        simulation = make_simulation()
        simulation.set_acceleration([0, -10])
        x = simulation.positions
        before = x.copy()
        self.assertEqual(x.shape, (16, 2))
        self.assertFalse(x.flags.writeable)
        self.assertFalse(x.flags.owndata)
        for _ in range(3):
            simulation.step()
        self.assertTrue((x == before).all())  # the state that it was taken from
        self.assertFalse((simulation.positions == before).all())
        v = simulation.velocities
        del simulation
        gc.collect()
        np.testing.assert_allclose(v, np.tile([0, -0.3], (16, 1)), atol=1e-8)

    def test_any_layout_and_integer_type_is_taken(self):
        vertices, cells = block()
        model = itr.Model(np.asfortranarray(vertices), cells.astype(np.int64)[:, ::1].copy(order="F"))
        model.set_options(OPTIONS)
        simulation = itr.Simulation(model)
        np.testing.assert_array_equal(simulation.cells, cells)
        np.testing.assert_array_equal(simulation.rest_positions, vertices)

    def test_three_dimensions(self):
        corners = np.array([[i & 1, i >> 1 & 1, i >> 2 & 1] for i in range(8)]) * 0.2
        cells = [[0, 1, 3, 7], [0, 3, 2, 7], [0, 2, 6, 7], [0, 6, 4, 7], [0, 4, 5, 7], [0, 5, 1, 7]]
        model = itr.Model(corners, cells)
        model.set_options(OPTIONS)
        simulation = itr.Simulation(model)
        simulation.set_velocities([1, 2, 3])
        simulation.step(0.02)
        np.testing.assert_allclose(simulation.positions - corners, np.tile([0.02, 0.04, 0.06], (8, 1)), atol=1e-9)


class Conditions(unittest.TestCase):
    def test_constants_arrays_and_functions_are_the_same(self):
        results = []
        for value in (
            [0.01, 0],
            np.tile([0.01, 0.0], (16, 1)),
            lambda X, t: np.stack([0 * X[:, 0] + 0.01, 0 * t * X[:, 1]], 1),
        ):
            simulation = make_simulation()
            simulation.fix("left", [0, 0])
            simulation.fix("right", value)
            simulation.step()
            results.append(simulation.positions)
        np.testing.assert_array_equal(results[0], results[1])
        np.testing.assert_array_equal(results[0], results[2])

    def test_functions_are_sampled_once_a_step_at_its_end(self):
        times = []
        simulation = make_simulation()
        simulation.fix("left", lambda X, t: times.append(t) or 0 * X)
        simulation.step()
        simulation.step(0.005)
        self.assertEqual(times, [0, 0.01, 0.015])
        simulation.release("left")
        simulation.step()
        self.assertEqual(len(times), 3)

    def test_masks_and_forces(self):
        simulation = make_simulation()
        simulation.fix("left", [0, 0], mask=[True, False])
        simulation.set_forces(np.tile([0, 1.0], (16, 1)))
        simulation.watch_forces()
        simulation.step()
        force, moment = simulation.resultant(["left", "right"])
        self.assertEqual((force.shape, moment.shape), ((2,), (1,)))
        np.testing.assert_allclose(simulation.forces("applied").sum(0), [0, 16])
        self.assertGreater(simulation.velocities[:, 1].min(), 0)
        self.assertEqual(simulation.forces("reaction").shape, (16, 2))
        simulation.set_forces(None)
        simulation.step()
        np.testing.assert_allclose(simulation.forces("applied"), 0)

    def test_obstacles_move(self):
        model = make_model(contact={"enabled": True, "dhat": 1e-3})
        model.set_option("/solver/contact", {"barrier_stiffness": 1e6})
        model.add_obstacle("wall", [[0.21, -1], [0.21, 1]], edges=[[0, 1]])
        simulation = itr.Simulation(model)
        simulation.fix("left", [0, 0])
        for x in (0.205, 0.2, 0.195):
            simulation.move_obstacle("wall", [[x, -1], [x, 1]])
            simulation.step()
        self.assertLess(simulation.positions[:, 0].max(), 0.195)
        self.assertGreater(simulation.report["energy"]["contact"], 0)


class Remeshing(unittest.TestCase):
    def setUp(self):
        self.simulation = make_simulation(**REMESH)
        self.simulation.fix("left", [0, 0])
        self.simulation.set_traction("right", [0, 2000])

    def test_fields_are_carried_along(self):
        own = {"field": self.simulation.rest_positions @ [2, 3] + 1, "changes": 0}

        def carry(change):
            own["changes"] += 1
            field = own["field"]
            own["field"] = change.interpolate(field)
            np.testing.assert_allclose(change.project(field), own["field"], atol=1e-12)
            np.testing.assert_allclose(change.interpolation() @ field, own["field"], atol=1e-15)
            np.testing.assert_allclose(change.project(np.stack([field, field], 1))[:, 1], own["field"], atol=1e-12)

        self.simulation.on_mesh_change(carry)
        for _ in range(4):
            self.simulation.step()
        self.assertGreater(own["changes"], 0)
        np.testing.assert_allclose(own["field"], self.simulation.rest_positions @ [2, 3] + 1, atol=1e-12)

    def test_saved_states_replay_with_the_same_bits(self):
        self.simulation.step()
        saved = self.simulation.save()
        runs = []
        for _ in range(2):
            self.simulation.restore(saved)
            for dt in (0.01, 0.02):
                self.simulation.step(dt)
            runs.append(self.simulation.positions)
        np.testing.assert_array_equal(runs[0], runs[1])

    def test_the_mesh_is_found_before_iterations(self):
        self.simulation.adapt(0.01)
        self.assertEqual(self.simulation.time, 0)
        self.assertGreater(len(self.simulation.positions), 16)
        self.simulation.freeze_mesh()
        n = len(self.simulation.positions)
        self.simulation.step(0.01)
        self.assertEqual(len(self.simulation.positions), n)


class Events(unittest.TestCase):
    def test_an_iteration_can_end_the_step(self):
        simulation = make_simulation()
        simulation.set_acceleration([0, -10])
        simulation.on_iteration(lambda iteration, energy, gradient, step: False)
        with self.assertRaises(itr.Cancelled):
            simulation.step()
        self.assertEqual(simulation.time, 0)
        simulation.on_iteration(None)
        simulation.step()

    def test_what_a_listener_raises_comes_out(self):
        simulation = make_simulation()
        simulation.set_acceleration([0, -10])

        def listen(*_):
            raise KeyError("mine")

        simulation.on_iteration(listen)
        with self.assertRaises(KeyError):
            simulation.step()
        self.assertEqual(simulation.time, 0)

    def test_messages_are_logged(self):
        messages = []
        model = make_model(space={"remesh": {"enabled": True}})  # how much a split has to gain is chosen, and told
        itr.Simulation(model, log=lambda level, text: messages.append((level, text)))
        self.assertTrue(any("split" in text for level, text in messages), messages)

    def test_threads_step_at_the_same_time(self):
        results = [None, None]

        def run(i):
            simulation = make_simulation()
            simulation.set_velocities([i, 1])
            while not simulation.finished:
                simulation.step()
            results[i] = simulation.positions

        threads = [threading.Thread(target=run, args=(i,)) for i in range(2)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        np.testing.assert_allclose(results[1] - results[0], np.tile([0.05, 0], (16, 1)), atol=1e-9)


class Errors(unittest.TestCase):
    def expect(self, text, call):
        with self.assertRaises(itr.InputError) as caught:
            call()
        self.assertIn(text, str(caught.exception))
        self.assertIsInstance(caught.exception, ValueError)

    def test_they_name_array_index_found_and_expected(self):
        vertices, cells = block()
        vertices[2, 1] = np.nan
        self.expect("vertices[5]: found nan; expected a finite number", lambda: itr.Model(vertices, cells))
        self.expect("cells[0]: found 99; expected a vertex", lambda: itr.Model(block()[0], [[99, 1, 2]]))
        self.expect("cells: found numbers of type float64; expected integers", lambda: itr.Model(block()[0], cells * 1.0))
        self.expect("/materials", lambda: itr.Simulation(itr.Model(*block())))
        self.expect("/time/dt: found -1", lambda: make_simulation(time={"dt": -1}))
        simulation = make_simulation()
        self.expect("boundary: found 'top'; expected 'left', 'right'", lambda: simulation.fix("top", [0, 0]))
        self.expect("displacements: found 6 numbers; expected 32", lambda: simulation.fix("left", np.zeros((3, 2))))
        self.expect("dt: found 0", lambda: simulation.step(0))
        self.expect("kind: found 'x'", lambda: simulation.forces("x"))
        self.expect("not all kinds of forces", lambda: simulation.resultant("left"))

    def test_a_step_that_cannot_be_done_raises_and_leaves_the_state(self):
        simulation = make_simulation(solver={"nonlinear": {"max_iterations": 1, "grad_norm": 1e-14}})
        simulation.fix("left", [0, 0])
        simulation.set_traction("right", [0, 5e4])
        with self.assertRaises(itr.StepFailed) as caught:
            simulation.step()
        self.assertIn("iterations", str(caught.exception))
        self.assertEqual(simulation.time, 0)


class Files(unittest.TestCase):
    def test_scenes(self):
        model = itr.Model.from_scene(ROOT / "examples/masticator.json", {"/time/tend": 0.1})
        simulation = itr.Simulation(model)
        self.assertEqual(simulation.step()["step"], 1)
        with self.assertRaises(itr.InputError) as caught:
            itr.Model.from_scene(ROOT / "examples/masticator.json", {"/time/dtt": 0.1})
        self.assertIn("/time/dtt", str(caught.exception))

    def test_meshio(self):
        try:
            import meshio
        except ImportError:
            self.skipTest("no meshio")
        vertices, cells = block()
        model = itr.Model.from_meshio(meshio.Mesh(np.pad(vertices, [(0, 0), (0, 1)]), [("triangle", cells)]))
        model.set_options(OPTIONS)
        simulation = itr.Simulation(model)
        simulation.set_velocities([1, 0])
        simulation.step()
        mesh = simulation.to_meshio()
        np.testing.assert_allclose(mesh.point_data["displacement"][:, 0], 0.01, atol=1e-9)
        self.assertEqual(mesh.cells[0].type, "triangle")


if __name__ == "__main__":
    unittest.main()
