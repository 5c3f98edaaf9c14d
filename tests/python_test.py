# SPDX-License-Identifier: MIT
"""The Python package: arrays in and out, steps, events, errors.

usage: PYTHONPATH=BUILD_DIR/python python_test.py SOURCE_DIR
"""

import ctypes
import gc
import inspect
import json
import pathlib
import shutil
import subprocess
import sys
import tempfile
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


EDGES = {2: [(0, 1), (1, 2), (2, 0)], 3: [(0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)]}


def with_middles(vertices, cells):
    """Nodes before the vertices that have odd ids, so that the order of neither is the simulation's."""
    d = vertices.shape[1]
    pairs = np.sort(np.concatenate([cells[:, list(edge)] for edge in EDGES[d]]), axis=1)
    edges, of_cell = np.unique(pairs, axis=0, return_inverse=True)
    nodes = np.concatenate([vertices[edges].mean(axis=1), vertices])
    return nodes, np.column_stack([cells + len(edges), of_cell.reshape(-1, len(cells)).T])


class QuadraticElements(unittest.TestCase):
    def make(self, options=OPTIONS):
        model = itr.Model(*with_middles(*block()))
        model.add_boundary("left", box=([0, 0], [0, 1]))
        model.set_options(options)
        return itr.Simulation(model)

    def test_nodes_follow_the_vertices(self):
        simulation = self.make()
        vertices, cells = block()
        np.testing.assert_array_equal(simulation.rest_positions[: simulation.num_vertices], vertices)
        np.testing.assert_array_equal(simulation.cells, cells)
        edges = simulation.curved_edges
        self.assertEqual(edges.shape, (33, 2))
        np.testing.assert_allclose(simulation.rest_positions[16:], vertices[edges].mean(axis=1), atol=1e-16)
        self.assertEqual(simulation.positions.shape, (16 + 33, 2))

    def test_positions_and_forces_are_of_all_nodes(self):
        simulation = self.make()
        X = simulation.rest_positions
        simulation.fix("left", np.stack([0.01 * X[:, 1] ** 2, 0 * X[:, 0]], 1))  # a curve that quadratic elements hold
        simulation.set_forces(np.tile([0, 1.0], (len(X), 1)))
        simulation.watch_forces()
        simulation.step()
        on_left = np.abs(X[:, 0]) < 1e-9
        np.testing.assert_allclose(simulation.positions[on_left, 0], 0.01 * X[on_left, 1] ** 2, atol=1e-12)
        np.testing.assert_allclose(simulation.forces("applied").sum(0), [0, len(X)])
        applied, reaction = simulation.forces("applied"), simulation.forces("reaction")
        force, _ = simulation.resultant("left")
        np.testing.assert_allclose(force, (applied + reaction)[on_left].sum(0), rtol=1e-12)

    def test_what_does_not_know_them_is_refused(self):
        simulation = self.make()
        with self.assertRaises(itr.InputError) as caught:
            simulation.set_follower_forces(lambda X, x, t: 0 * x)
        self.assertIn("curved edges", str(caught.exception))
        nodes, cells = with_middles(*block())
        nodes[0] += 0.01
        with self.assertRaises(itr.InputError) as caught:
            itr.Model(nodes, cells)
        self.assertIn("straight at rest", str(caught.exception))

    def test_meshio_there_and_back(self):
        try:
            import meshio
        except ImportError:
            self.skipTest("no meshio")
        corners = np.array([[i & 1, i >> 1 & 1, i >> 2 & 1] for i in range(8)]) * 0.2
        cells = np.array([[0, 1, 3, 7], [0, 3, 2, 7], [0, 2, 6, 7], [0, 6, 4, 7], [0, 4, 5, 7], [0, 5, 1, 7]])
        cells[1] = cells[1][[0, 1, 3, 2]]  # one that is inverted
        for kind, (points, blocks) in {"triangle6": block(), "tetra10": (corners, cells)}.items():
            nodes, quadratic = with_middles(points, blocks)
            model = itr.Model.from_meshio(meshio.Mesh(nodes, [(kind, quadratic)]))
            model.set_options(OPTIONS)
            simulation = itr.Simulation(model)
            simulation.set_velocities(simulation.rest_positions**2)
            simulation.step()
            mesh = simulation.to_meshio()
            self.assertEqual(mesh.cells[0].type, kind)
            d = points.shape[1]
            again = mesh.points[:, :d] - mesh.point_data["displacement"][:, :d]
            for row in mesh.cells[0].data:
                for node, (i, j) in zip(row[d + 1 :], EDGES[d]):
                    np.testing.assert_allclose(again[node], (again[row[i]] + again[row[j]]) / 2, atol=1e-12)

    def test_dolfinx(self):
        try:
            import dolfinx.fem
            import ufl
        except ImportError:
            self.skipTest("no dolfinx")
        simulation = self.make()
        simulation.set_velocities(simulation.rest_positions**2)
        simulation.step()
        mesh, functions = simulation.to_dolfinx()
        F = ufl.Identity(2) + ufl.grad(functions["displacement"])
        mu, lame = 1e5 / 2.6, 0.3 * 1e5 / (1 - 0.3**2)
        W = mu / 2 * (ufl.tr(F.T * F) - 2 - 2 * ufl.ln(ufl.det(F))) + lame / 2 * ufl.ln(ufl.det(F)) ** 2
        form = dolfinx.fem.form(W * ufl.dx(mesh, metadata={"quadrature_degree": 2}))
        self.assertAlmostEqual(dolfinx.fem.assemble_scalar(form) / simulation.report["energy"]["elastic"], 1, delta=1e-10)


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

    def test_eigenstrains(self):
        results = []
        for strain in (0.01, np.full(16, 0.01), lambda X, t: 0 * X[:, 0] + 0.01, None):
            simulation = make_simulation(time={"quasistatic": True})
            simulation.fix("left", [0, 0])
            simulation.set_eigenstrain(strain)
            simulation.step()
            results.append(np.ptp(simulation.positions, axis=0))
        for size in results[:3]:
            np.testing.assert_allclose(size, results[0], rtol=1e-12)
        self.assertGreater(results[0][0], 0.2 * 1.009)
        np.testing.assert_allclose(results[3], 0.2, rtol=1e-12)

    def test_masks_and_forces(self):
        simulation = make_simulation()
        simulation.fix("left", [0, 0], mask=[True, False])
        simulation.set_forces(np.tile([0, 1.0], (16, 1)))
        simulation.watch_forces()
        simulation.step()
        force, moment = simulation.resultant(["left", "right"])
        self.assertEqual((force.shape, moment.shape), ((2,), (1,)))
        self.assertEqual(simulation.von_mises.shape, (18,))
        self.assertEqual(simulation.stress.shape, (18, 4))
        np.testing.assert_array_equal(simulation.contact_pressure, np.zeros(16))
        np.testing.assert_allclose(simulation.forces("applied").sum(0), [0, 16])
        self.assertGreater(simulation.velocities[:, 1].min(), 0)
        self.assertEqual(simulation.forces("reaction").shape, (16, 2))
        simulation.set_forces(None)
        simulation.step()
        np.testing.assert_allclose(simulation.forces("applied"), 0)

    def test_resultants_are_of_names_and_ids(self):
        model = make_model(contact={"enabled": True, "dhat": 1e-3})
        wall = model.add_obstacle("wall", [[0.2005, -1], [0.2005, 1]], edges=[[0, 1]])
        simulation = itr.Simulation(model)
        simulation.watch_forces()
        simulation.step()
        force = simulation.resultant("wall")[0]
        self.assertGreater(force[0], 0)  # the block pushes it away
        for parts in (wall, str(wall), np.int64(wall), [wall], ["wall", wall], f"obstacle:{wall}", "obstacle:wall"):
            np.testing.assert_array_equal(simulation.resultant(parts)[0], force)
        for parts in (0, "0", "body:0"):
            np.testing.assert_allclose(simulation.resultant(parts)[0], -force, rtol=1e-10)
        for parts in (77, "77", -1, "lefd", ["left", 77], "body:1", 1.5, None, []):
            with self.subTest(parts), self.assertRaises(itr.InputError):
                simulation.resultant(parts)

    def test_pressures_and_accelerations_are_constants_arrays_or_functions(self):
        for method, constant, shape in (("set_pressure", 50.0, (16,)), ("set_acceleration", [1.0, -10.0], (16, 2))):
            results = []
            for value in (constant, np.broadcast_to(constant, shape), lambda X, t: np.broadcast_to(constant, shape)):
                simulation = make_simulation()
                simulation.fix("left", [0, 0])
                getattr(simulation, method)(*(["right"] if method == "set_pressure" else []), value)
                simulation.step()
                results.append(simulation.positions)
            self.assertGreater(np.abs(results[0] - simulation.rest_positions).max(), 1e-6)
            np.testing.assert_allclose(results[1], results[0], atol=1e-12)
            np.testing.assert_allclose(results[2], results[0], atol=1e-12)

    def test_forces_of_present_positions(self):
        k, iterations, results = 300, [], []
        calls = []

        def springs(X, x, t):
            calls.append((X.shape, x.shape, t))
            return -k * x

        def stiffness(X, x, t):
            return np.arange(len(X))[:, None], np.tile(k * np.eye(2), (len(X), 1, 1))

        for more in ((), (stiffness,)):
            simulation = make_simulation()
            simulation.set_follower_forces(springs, *more)
            iterations.append(simulation.step()["newton_iterations"])
            results.append(simulation.positions)
        self.assertEqual(set(calls), {((16, 2), (16, 2), 0.01)})
        self.assertLess(iterations[1], iterations[0])
        np.testing.assert_allclose(results[1], results[0], atol=1e-9)
        # A free body: velocity times mass is the impulse of the forces at the end of the step.
        momentum = simulation.velocities[simulation.cells].mean(1).sum(0) * 1000 * 0.2**2 / 18
        np.testing.assert_allclose(momentum, 0.01 * (-k * results[1]).sum(0), rtol=1e-9)
        simulation.set_follower_forces(None)
        simulation.step()

    def test_obstacles_move(self):
        model = make_model(contact={"enabled": True, "dhat": 1e-3})
        model.set_option("/solver/contact", {"barrier_stiffness": 1e6})
        model.add_obstacle("wall", [[0.21, -1], [0.21, 1]], edges=[[0, 1]])
        simulation = itr.Simulation(model)
        simulation.fix("left", [0, 0])
        for x in (0.205, 0.2, 0.195):
            simulation.move_obstacle("wall", [[x, -1], [x, 1]])
            simulation.step()
        simulation.move_obstacle("wall", lambda t: np.array([[0.235 - t, -1], [0.235 - t, 1]]))
        simulation.step()
        self.assertAlmostEqual(simulation.obstacle_positions[0, 0], 0.195)
        self.assertLess(simulation.positions[:, 0].max(), 0.195)
        self.assertGreater(simulation.report["energy"]["contact"], 0)


COMPILED = """
#include <itr/itr.h>
#include <math.h>
/* user: mu and lambda of W = mu/2 (|F|^2 - 2 - 2 ln J) + lambda/2 (ln J)^2 */
double density(int d, const double* F, void* user) {
  const double *l = user, log_j = log(F[0] * F[3] - F[1] * F[2]);
  return l[0] / 2 * (F[0] * F[0] + F[1] * F[1] + F[2] * F[2] + F[3] * F[3] - d - 2 * log_j) + l[1] / 2 * log_j * log_j;
}
void stress(int d, const double* F, double* P, void* user) {
  const double *l = user, J = F[0] * F[3] - F[1] * F[2], T[] = {F[3] / J, -F[2] / J, -F[1] / J, F[0] / J};
  for (int i = 0; i < d * d; ++i) P[i] = l[0] * (F[i] - T[i]) + l[1] * log(J) * T[i];
}
void hessian(int d, const double* F, double* H, void* user) {
  const double *l = user, J = F[0] * F[3] - F[1] * F[2], T[] = {F[3] / J, -F[2] / J, -F[1] / J, F[0] / J};
  const double c = l[0] - l[1] * log(J), C[4][4] = {{0, 0, 0, 1}, {0, 0, -1, 0}, {0, -1, 0, 0}, {1, 0, 0, 0}};
  for (int i = 0; i < d * d; ++i)
    for (int j = 0; j < d * d; ++j) H[4 * j + i] = (i == j ? l[0] : 0) + (c + l[1]) * T[i] * T[j] - c * C[i][j] / J;
}
/* springs of stiffness *user at the vertices: not for a mesh that changes */
double energy(const itr_part* part, const double* x, void* user) {
  double sum = 0;
  for (size_t i = 0; i < 2 * part->num_vertices; ++i) sum += *(double*)user / 2 * x[i] * x[i];
  return sum;
}
void add_gradient(const itr_part* part, const double* x, double* g, void* user) {
  for (size_t i = 0; i < 2 * part->num_vertices; ++i) g[i] += *(double*)user * x[i];
}
void add_hessian(const itr_part* part, const double* x, itr_block_receiver add, void* to, void* user) {
  const double k = *(double*)user, block[] = {k, 0, 0, k};
  for (int v = 0; v < (int)part->num_vertices; ++v) add(to, 1, &v, block);
}
"""


@unittest.skipUnless(shutil.which("cc"), "no C compiler")
class CompiledFunctions(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(cls.folder.cleanup)
        source = pathlib.Path(cls.folder.name, "own.c")
        source.write_text(COMPILED)
        library = source.with_suffix(".so")
        subprocess.run(["cc", "-O2", "-shared", "-fPIC", f"-I{ROOT}/include", source, "-o", library, "-lm"], check=True)
        cls.own = ctypes.CDLL(str(library))

    def test_are_laws(self):
        lame = (ctypes.c_double * 2)(1e5 / 2.6, 0.3 * 1e5 / (1 - 0.3**2))
        energies = []
        for own in (False, True):
            model = make_model()
            if own:
                model.set_law(0, self.own.density, self.own.stress, self.own.hessian, ctypes.addressof(lame))
            simulation = itr.Simulation(model)
            simulation.fix("left", [0, 0])
            simulation.set_acceleration([0, -100])
            for _ in range(3):
                energies.append(simulation.step()["energy"]["elastic"])
        np.testing.assert_allclose(energies[3:], energies[:3], rtol=1e-8)

    def test_are_terms(self):
        k = ctypes.c_double(300)
        simulation, other = make_simulation(), make_simulation()
        simulation.set_term("springs", self.own.energy, self.own.add_gradient, self.own.add_hessian, ctypes.addressof(k))
        other.set_follower_forces(lambda X, x, t: -300 * x)
        for s in (simulation, other):
            s.step()
        np.testing.assert_allclose(simulation.positions, other.positions, atol=1e-9)
        self.assertGreater(simulation.report["energy"]["host"], 0)
        simulation.remove_term("springs")
        self.assertEqual(simulation.step()["energy"]["host"], 0)
        with self.assertRaises(itr.InputError) as caught:
            simulation.set_term("springs", self.own.energy, None, self.own.add_hessian)
        self.assertIn("term.add_gradient: found NULL; expected a function", str(caught.exception))
        with self.assertRaises(itr.InputError) as caught:
            simulation.set_term("springs", lambda part, x: 0, self.own.add_gradient, self.own.add_hessian)
        self.assertIn("found a function; expected a compiled one", str(caught.exception))


class Cracks(unittest.TestCase):
    """The faces of a crack coincide at rest: what is asked of one is not asked of the other."""

    contact = {"enabled": False}

    def crack(self, remesh=None, size=8):
        """A unit square with a crack along y = 1/2 from the left side to the middle."""
        vertices = [(i / size, j / size) for j in range(size + 1) for i in range(size + 1)]
        at = lambda i, j: j * (size + 1) + i  # noqa: E731
        twin = {at(i, size // 2): len(vertices) + i for i in range(size // 2)}
        vertices += [vertices[v] for v in twin]
        cells = []
        for j in range(size):
            for i in range(size):
                a, b, c, d = (v if j < size // 2 else twin.get(v, v)
                              for v in (at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)))
                cells += [(a, b, c), (a, c, d)]
        self.lower = list(twin)
        self.upper = list(twin.values())
        tip = at(size // 2, size // 2)
        model = itr.Model(np.array(vertices), np.array(cells))
        model.add_boundary("right", box=([1, 0], [1, 1]))
        faces = [face + [tip] for face in (self.lower, self.upper)]
        model.add_boundary("faces", facets=np.array([pair for face in faces for pair in zip(face, face[1:])]))
        model.set_options({**OPTIONS, "time": {"dt": 1, "time_steps": 5, "quasistatic": True},
                           "contact": self.contact})
        if remesh:
            model.set_options({"space": {"remesh": {"enabled": True, **remesh}}})
        simulation = itr.Simulation(model)
        simulation.fix("right", [0, 0])
        simulation.watch_forces()
        return simulation

    def sides(self, simulation):
        """By vertex 1 above the crack and at its upper face, -1 below and at the lower one, 0 on the line ahead of it."""
        rest, cells = simulation.rest_positions, simulation.cells
        side = np.sign(rest[:, 1] - 0.5)
        on = (np.abs(rest[:, 1] - 0.5) < 1e-9) & (rest[:, 0] < 0.5 - 1e-9)
        for cell in cells:
            for v in cell[on[cell]]:
                side[v] = np.sign(rest[cell].mean(axis=0)[1] - 0.5)
        return side, on

    def test_values_by_vertex_are_of_their_face(self):
        simulation = self.crack()
        u = np.zeros_like(simulation.rest_positions)
        u[self.lower, 1], u[self.upper, 1] = -0.02, 0.02
        simulation.fix("faces", u)
        simulation.step()
        moved = simulation.positions - simulation.rest_positions
        np.testing.assert_allclose(moved[self.lower + self.upper], u[self.lower + self.upper], atol=1e-15)

    def test_tractions_act_on_their_face_while_the_mesh_changes(self):
        for remesh in (None, {"split": {"acceptance_tolerance": 1e-2}}):
            simulation = self.crack(remesh)
            f = np.zeros_like(simulation.rest_positions)
            f[self.lower, 1], f[self.upper, 1] = -500, 500
            simulation.set_traction("faces", f)
            simulation.step()
            side, on = self.sides(simulation)
            applied = simulation.forces("applied")[:, 1]
            force = 500 * (4 - 0.5) / 8  # it falls to 0 at the tip, along the last edge
            for one in (-1, 1):
                own = applied[on & (side == one)].sum()
                self.assertLess(one * own, force + 1e-9)
                self.assertGreater(one * own, force - 500 / 8)  # the tip has the rest
            if remesh:
                self.assertGreater(simulation.report["splits"], 0)

    def test_forces_stay_at_their_face_while_vertices_go(self):
        simulation = self.crack({"split": {"acceptance_tolerance": 1}, "collapse": {"rel_max_edge_length": 2}})
        f = np.zeros_like(simulation.rest_positions)
        f[self.lower[0], 1], f[self.upper[0], 1] = -500, 500
        simulation.set_forces(f)
        simulation.step()
        self.assertGreater(simulation.report["collapses"], 0)
        side, _ = self.sides(simulation)
        applied = simulation.forces("applied")[:, 1]
        for one in (-1, 1):
            self.assertAlmostEqual(applied[side == one].sum(), one * 500, delta=1e-6)
        mouth = np.abs(simulation.rest_positions - [0, 0.5]).max(axis=1) < 1e-9
        self.assertGreater(np.ptp(simulation.positions[mouth, 1]), 0.1)

    def test_what_is_new_comes_from_its_face(self):
        simulation = self.crack({"split": {"acceptance_tolerance": 1e-3}})
        f = np.zeros_like(simulation.rest_positions)
        f[self.lower, 1], f[self.upper, 1] = -500, 500
        simulation.set_traction("faces", f)

        def facet_sides():
            side, on = self.sides(simulation)
            return [side[facet[on[facet]]].sum() for facet in simulation.facets]

        before = [self.sides(simulation)[0], facet_sides()]
        seen = [0]

        def listen(change):
            side, on = self.sides(simulation)
            carried, facets = change.interpolate(before[0]), facet_sides()
            self.assertGreater((carried * side)[on].min(), 0)
            for facet, parent in enumerate(change.facet_parent):
                self.assertGreaterEqual(facets[facet] * before[1][parent], 0)
            seen[0] += 1
            before[:] = [side, facets]

        simulation.on_mesh_change(listen)
        for _ in range(2):
            simulation.step()
        self.assertGreater(seen[0], 0)


class CracksWithContact(Cracks):
    """Such faces are no contact until they have come apart."""

    contact = {"enabled": True, "dhat": 1e-3}


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

    def test_a_projection_is_over_with_its_listener(self):
        kept = []
        self.simulation.on_mesh_change(kept.append)
        for _ in range(3):
            self.simulation.step()
        for change in kept:
            with self.assertRaisesRegex(itr.InputError, "after that of the listener"):
                change.project(np.ones(16))

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

    def test_a_listener_sees_the_state_before_the_step_and_may_not_change_it(self):
        simulation = make_simulation()
        simulation.set_acceleration([0, -10])
        simulation.step()
        before, start = simulation.positions.copy(), simulation.save()
        simulation.set_acceleration([0, -20])
        kept = []

        def listen(*_):
            kept.append((simulation.positions, simulation.save()))
            for change in (
                lambda: simulation.restore(start),
                lambda: simulation.set_velocities([0, 0]),
                lambda: simulation.step(),
                lambda: simulation.adapt(0.01),
                lambda: simulation.set_acceleration([0, 0]),
                lambda: simulation.on_iteration(None),
                lambda: simulation.on_mesh_change(None),
            ):
                with self.assertRaisesRegex(itr.InputError, "from inside of a step"):
                    change()
            return True

        simulation.on_iteration(listen)
        simulation.step()
        self.assertTrue(kept)
        after = simulation.positions
        for x, saved in kept:
            np.testing.assert_array_equal(x, before)
            simulation.restore(saved)
            self.assertEqual(simulation.steps, 1)
        simulation.on_iteration(None)
        simulation.step()
        np.testing.assert_array_equal(simulation.positions, after)

    def test_a_snapshot_of_another_simulation_is_refused(self):
        saved = make_simulation().save()
        with self.assertRaisesRegex(itr.InputError, "another simulation"):
            make_simulation().restore(saved)

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
        self.expect("forces: found none", lambda: simulation.resultant("left"))

    def test_they_are_of_values_and_functions_too(self):
        simulation = make_simulation()
        self.expect("traction: found nan; expected a finite number", lambda: simulation.set_traction("left", [np.nan, 0]))
        self.expect("acceleration: found 3 numbers; expected 2", lambda: simulation.set_acceleration([0, 0, -1]))
        simulation.set_follower_forces(lambda X, x, t: np.zeros(3))
        self.expect("follower forces: found 3 numbers; expected 32", simulation.step)
        simulation.set_follower_forces(lambda X, x, t: "none")
        self.expect("follower forces: found no array of numbers; expected 32", simulation.step)
        simulation.set_follower_forces(lambda X, x, t: 0 * x, lambda X, x, t: ([[0, 1]], np.zeros((1, 2, 2))))
        self.expect("follower stiffness.block: found 4 numbers; expected 16", simulation.step)
        self.assertEqual(simulation.time, 0)

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

    def test_records_and_writes_a_page(self):
        with tempfile.TemporaryDirectory() as folder:
            folder = pathlib.Path(folder)
            simulation = make_simulation(**REMESH)
            simulation.write_report(folder / "now.html")
            self.assertIn('"step":0', (folder / "now.html").read_text())
            simulation.record(folder / "run", every=2)
            for _ in range(5):
                simulation.step()
            self.assertEqual(simulation.write_report(folder / "run.html"), [])
            text = (folder / "run.html").read_text()
            self.assertTrue('"outcome":"finished"' in text)
            self.assertTrue('"step":4' in text and '"step":3' not in text)
            self.assertEqual(len(list((folder / "run/frames").glob("*.h5"))), 3)
            self.assertIn("every 2nd", simulation.write_report(folder / "run.html", every=2)[0])
            with self.assertRaises(itr.InputError) as caught:
                make_simulation().record(folder / "run")
            self.assertIn("another run", str(caught.exception))
            del simulation
            other = make_simulation()
            with self.assertRaises(itr.InputError) as caught:
                other.record(folder / "run")
            self.assertIn("results of an earlier run", str(caught.exception))
            (folder / "run/frames/notes.tmp").write_text("mine")
            other.record(folder / "run", overwrite=True)
            self.assertEqual(len(list((folder / "run/frames").glob("*.h5"))), 1)
            self.assertEqual((folder / "run/frames/notes.tmp").read_text(), "mine")

    def test_one_at_a_time_records_in_a_folder(self):
        with tempfile.TemporaryDirectory() as folder:
            first, second = make_simulation(), make_simulation()
            first.record(folder)
            with self.assertRaises(itr.InputError) as caught:
                second.record(folder, overwrite=True)
            self.assertIn(str(folder), str(caught.exception))
            first.step()
            self.assertEqual(len(list(pathlib.Path(folder, "frames").glob("*.h5"))), 2)
            del first
            second.record(folder, overwrite=True)
            self.assertEqual(len(list(pathlib.Path(folder, "frames").glob("*.h5"))), 1)

    def test_records_steps_whose_listener_raises(self):
        class Mine(Exception):
            pass

        def listener(change):
            raise Mine

        with tempfile.TemporaryDirectory() as folder:
            simulation = make_simulation(**REMESH)
            simulation.fix("left", [0, 0])
            simulation.set_traction("right", [0, -2000.0])
            simulation.record(folder)
            simulation.on_mesh_change(listener)
            raised = 0
            for _ in range(5):
                try:
                    simulation.step()
                except Mine:
                    raised += 1
            self.assertGreater(raised, 0)
            self.assertEqual(simulation.steps, 5)
            lines = (pathlib.Path(folder) / "steps.jsonl").read_text().splitlines()
            self.assertEqual([json.loads(line)["step"] for line in lines], list(range(6)))
            self.assertEqual(len(list((pathlib.Path(folder) / "frames").glob("*.h5"))), 6)

            simulation.on_iteration(lambda *_: False)  # a step that is dropped is not one
            with self.assertRaises(itr.Cancelled):
                simulation.step()
            self.assertEqual(len((pathlib.Path(folder) / "steps.jsonl").read_text().splitlines()), 6)

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
        self.assertEqual(mesh.cell_data["body"][0].tolist(), [0] * 18)
        np.testing.assert_allclose(mesh.point_data["displacement"][:, 0], 0.01, atol=1e-9)
        self.assertEqual(mesh.cells[0].type, "triangle")

    def test_meshio_with_groups(self):
        try:
            import meshio
        except ImportError:
            self.skipTest("no meshio")
        vertices, cells = block()
        points = np.vstack([[[9.0, 9.0]], vertices])  # one that no cell has, as Gmsh leaves them
        turned = cells[9:, ::-1]  # clockwise
        blocks = [("line", [[1, 5], [5, 9]]), ("triangle", cells[:9] + 1), ("line", [[4, 8]]), ("triangle", turned + 1)]
        groups = [np.array([7, 7]), np.full(9, 1), np.array([8]), np.full(9, 2)]
        mesh = meshio.Mesh(points, blocks, cell_data={"gmsh:physical": groups}, field_data={"left": np.array([7, 1])})
        model = itr.Model.from_meshio(mesh)
        model.set_options(OPTIONS)
        materials = [{**OPTIONS["materials"], "id": body} for body in (1, 2)]
        model.set_options({"materials": materials})
        simulation = itr.Simulation(model)
        np.testing.assert_array_equal(simulation.rest_positions, vertices)
        np.testing.assert_array_equal(np.sort(simulation.cells, 1), np.sort(cells, 1))
        self.assertEqual(simulation.bodies.tolist(), [1] * 9 + [2] * 9)
        self.assertEqual(sorted(simulation.facet_boundaries)[-3:], [1, 1, 2])
        simulation.fix("left", [0, 0])
        simulation.fix("8", [0, 0])
        quads = meshio.Mesh(points, [("triangle", cells + 1), ("quad", [[1, 2, 6, 5]])])
        with self.assertRaises(itr.InputError) as caught:
            itr.Model.from_meshio(quads)
        self.assertEqual(
            str(caught.exception),
            "mesh: found cells quad; expected tetra, triangle, tetra10 or triangle6 only: itr.simplices splits others",
        )

    def test_meshio_with_sets(self):
        try:
            import meshio
        except ImportError:
            self.skipTest("no meshio")
        vertices, cells = block()
        left, lower = np.flatnonzero(vertices[:, 0] == 0), np.flatnonzero(vertices[:, 1] == 0)
        mesh = meshio.Mesh(
            vertices,
            [("triangle", cells)],
            point_sets={"left": left, "around": np.union1d(left, lower), "one": left[:1]},
            cell_sets={"soft": [np.arange(9)], "all": [np.arange(18)]},
        )
        model = itr.Model.from_meshio(mesh)
        material = OPTIONS["materials"]
        options = {**OPTIONS, "materials": [{**material, "id": "all"}]}
        options["boundary_conditions"] = {"dirichlet_boundary": [
            {"id": "left", "value": [0, 0], "dimension": [True, False]},
            {"id": "around", "value": [0, 0], "dimension": [False, True]}]}
        model.set_options(options)
        simulation = itr.Simulation(model)
        self.assertEqual(sorted(set(simulation.bodies.tolist())), [0, 1])
        self.assertEqual(len(set(simulation.facet_boundaries.tolist()) - {-1}), 2)  # left of both, the rest of around
        simulation.set_velocities([1, 1])
        simulation.step()
        moved = simulation.positions - simulation.rest_positions
        self.assertEqual(np.abs(moved[left]).max(), 0)
        self.assertEqual(np.abs(moved[lower, 1]).max(), 0)
        self.assertGreater(np.abs(moved[lower, 0]).max(), 0)
        simulation.watch_forces()
        simulation.step()
        np.testing.assert_array_equal(simulation.resultant("soft")[0], simulation.resultant("body:1")[0])
        with self.assertRaises(itr.InputError) as caught:
            model.set_options({"materials": [{**material, "id": "hard"}]})
            itr.Simulation(model)
        self.assertIn('"all", "soft"', str(caught.exception))

    def test_dolfinx(self):
        try:
            import dolfinx.fem
            import ufl
        except ImportError:
            self.skipTest("no dolfinx")
        simulation = make_simulation(**REMESH)
        simulation.fix("left", [0, 0])
        simulation.set_traction("right", [0, 2000])
        for _ in range(3):
            simulation.step()
        mesh, functions = simulation.to_dolfinx()
        self.assertGreater(len(simulation.cells), 18)
        self.assertEqual(mesh.topology.index_map(2).size_local, len(simulation.cells))
        integrate = lambda form: dolfinx.fem.assemble_scalar(dolfinx.fem.form(form))
        # The integrals are those of the simulation: volumes by cell, energy, and F = I + grad u of det F > 0.
        X, cells = simulation.rest_positions, simulation.cells
        areas = np.abs(np.linalg.det(X[cells[:, 1:]] - X[cells[:, :1]])) / 2
        u, density = functions["displacement"], functions["elastic_density"]
        mean = (simulation.positions - X)[cells].mean(1)
        for k in range(2):
            self.assertAlmostEqual(integrate(u[k] * ufl.dx(mesh)), areas @ mean[:, k], delta=1e-14)
            self.assertAlmostEqual(
                integrate(functions["velocity"][k] * ufl.dx(mesh)), areas @ simulation.velocities[cells].mean(1)[:, k], delta=1e-12
            )
        F = ufl.Identity(2) + ufl.grad(u)
        mu, lame = 1e5 / 2.6, 0.3 * 1e5 / (1 - 0.3**2)
        W = mu / 2 * (ufl.tr(F.T * F) - 2 - 2 * ufl.ln(ufl.det(F))) + lame / 2 * ufl.ln(ufl.det(F)) ** 2
        self.assertAlmostEqual(integrate(density * ufl.dx(mesh)) / integrate(W * ufl.dx(mesh)), 1, delta=1e-10)

    def test_studies(self):
        try:
            from itr._study import _find_command

            _find_command()
        except itr.InputError as error:
            self.skipTest(str(error))
        scene = ROOT / "examples/cantilever.json"
        small = {"/geometry/0/n_refs": 1, "/time/dt": 0.5}
        with tempfile.TemporaryDirectory() as folder:
            found = itr.study(scene, folder, small, series=["uniform"], levels=1, frames=2)
            self.assertIn("uniform-1", [run["run"] for run in found["runs"]])
            with self.assertRaises(itr.InputError) as caught:
                itr.study(scene, folder + "/other", {"/time/dtt": 1}, levels=1)
            self.assertIn("/time/dtt", str(caught.exception))


class Package(unittest.TestCase):
    def test_everything_public_has_hints_and_says_what_it_is(self):
        self.assertTrue((pathlib.Path(itr.__file__).parent / "py.typed").exists())
        for name in itr.__all__:
            thing = getattr(itr, name)
            members = {name: thing} if inspect.isfunction(thing) else {}
            if inspect.isclass(thing) and thing.__module__ == "itr":
                self.assertTrue(thing.__doc__, name)
                members = {f"{name}.{key}": value for key, value in vars(thing).items() if key[0] != "_" or key == "__init__"}
            for key, value in members.items():
                function = value.fget if isinstance(value, property) else getattr(value, "__func__", value)
                if not inspect.isfunction(function):
                    continue
                hints = function.__annotations__
                parameters = [p for p in inspect.signature(function).parameters if p not in ("self", "cls")]
                self.assertEqual([p for p in parameters if p not in hints], [], key)
                if not key.endswith("__init__"):
                    self.assertIn("return", hints, key)


if __name__ == "__main__":
    unittest.main()
