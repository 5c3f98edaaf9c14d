# SPDX-License-Identifier: MIT
"""Manufactured solutions. In space: a static field that no element contains, for every law, by P1 and P2. In time: a motion that is
linear in space, so that the mesh adds no error, for every integrator and law."""
import numpy as np
import sympy
from harness import manufactured
from harness.fields import errors, fitted_order
from harness.manufactured import X, divergence, expression, function_of_space, gradient, stress, t
from harness.materials import laws, words
from harness.scenes import box_mesh, run_scene, scene, with_edge_nodes, write_mesh
from harness.suite import Result, excess

TITLE = "Orders of convergence"
QUANTITY = "order fitted over the series of element sizes or time steps (value), against the theory's (reference)"
REFERENCE = "manufactured solutions: loads by sympy from the law's formula and the motion"
TOLERANCE = "fitted order at least the expected one - 0.1"
NEEDS = ("meshio", "h5py", "sympy")

SIZE = [1.0, 0.6, 0.5]
SERIES = {(2, 1): [10, 20, 40, 80], (3, 1): [5, 8, 12], (2, 2): [5, 10, 20, 40], (3, 2): [4, 8, 12]}  # cells along x
QUICK_SERIES = {(2, 1): [10, 20, 40], (2, 2): [5, 10, 20]}  # by dimension and order of the elements

IN_FOUR_STEPS = {"dt": 0.25, "tend": 1, "quasistatic": True}  # at once St. Venant-Kirchhoff may invert on the way


def field(dim):
    """A displacement with strains of a tenth at t = 1: St. Venant-Kirchhoff buckles under twice as much in 3D. There it is a
    gradient, see manufactured.Symbolic."""
    x, y, z = X
    if dim == 2:
        return [t * sympy.sin(2 * x + y) / 12, t * sympy.cos(x - 2 * y) / 15]
    potential = t * (sympy.sin(2 * x) * sympy.sin(2 * y) / 80 + sympy.sin(x) * sympy.cos(2 * z) / 60)
    return [potential.diff(s) for s in X]


def in_space(context, name, law, dim, order):
    """Sizes and errors (L2, H1 seminorm) of a series of meshes."""
    material = law.scene[0]
    u = field(dim)
    slope = gradient(u)
    P = stress(law.density, law.parameters(material, dim), sympy.eye(dim) + slope)
    conditions = {"rhs": [expression(d / sympy.Float(material["rho"])) for d in divergence(P)],
                  "dirichlet_boundary": [{"id": k, "value": [expression(c) for c in u]}
                                         for k in range(1, 2 * dim + 1) if k != 3],
                  "neumann_boundary": [{"id": 3, "value": [expression(P[i, 0]) for i in range(dim)]}]}
    exact, exact_gradient = (function_of_space(sympy.Matrix(value).subs(t, 1), dim) for value in (u, slope))
    series = (QUICK_SERIES if context.quick else SERIES)[dim, order]
    found = []
    for n in series:
        points, cells = box_mesh([max(1, round(n * s)) for s in SIZE[:dim]], SIZE[:dim], jitter=0.15)
        mesh = context.folder / f"box{dim}-{n}.msh"
        write_mesh(mesh, points, cells)
        content = scene(mesh, material, order, boundary_conditions=conditions, time=IN_FOUR_STEPS)
        run = run_scene(context, f"{dim}d-p{order}-{words(name)}-{n}", content)
        if order == 2:
            points, cells, _ = with_edge_nodes(points, cells)
        found.append(errors(points, cells, run.last().u, exact, exact_gradient, order))
    return 1 / np.array(series), np.array(found).T


# Integrator, order, whether the motion may start with any velocity and acceleration: the first steps of BDF3 and above are
# of lower order, which shows unless the motion starts smoothly from rest.
RULES = [("ImplicitEuler", 1, True), ("ImplicitNewmark", 2, True), ("BDF2", 2, True), ("BDF3", 3, False),
         ("BDF4", 4, False), ("BDF5", 5, False), ("BDF6", 6, False)]
END = 0.4


def motion(any_start):
    """Its amplitude as a function of time, 0 at t = 0."""
    return sympy.sin(4 * t + 1) - sympy.sin(1) if any_start else (sympy.sin(3 * t)**8) * 2


def in_time(context, name, material, law, rule, any_start, steps, consistent=True):
    """Time steps and errors (displacement, velocity): mean squares over the second half, where BDF's first steps, of lower
    order, have no velocities any more."""
    dim = 2
    B = sympy.Matrix([[0.15, 0.1], [-0.06, 0.12]])
    g = motion(any_start)
    place = sympy.Matrix(X[:dim])
    u = list(g * B * place)
    P = stress(law.density, law.parameters(material, dim), sympy.eye(dim) + g * B)
    conditions = {"rhs": [expression(-c.diff(t, 2)) for c in u],
                  "dirichlet_boundary": [{"id": 1, "value": [expression(c) for c in u]}],
                  "neumann_boundary": [{"id": tag, "value": [expression(sign * P[i, axis]) for i in range(dim)]}
                                       for tag, axis, sign in ((2, 1, -1), (3, 0, 1), (4, 1, 1))]}
    initial = {"velocity": [{"id": 1, "value": [expression(c.diff(t).subs(t, 0)) for c in u]}]}
    if consistent:
        initial["acceleration"] = "consistent"
    points, cells = box_mesh([3, 2], SIZE[:dim], jitter=0.2)
    mesh = context.folder / "small.msh"
    write_mesh(mesh, points, cells)
    amplitude, rate = sympy.lambdify(t, g), sympy.lambdify(t, g.diff(t))
    shape = points @ np.array(B, dtype=float).T
    found = []
    for n in map(int, steps):
        content = scene(mesh, material, boundary_conditions=conditions, initial_conditions=initial,
                        time={"dt": END / n, "time_steps": n, "integrator": rule})
        run = run_scene(context, f"time-{words(name)}-{rule}{'' if consistent else '-zero'}-{n}", content)
        later = [frame for frame in run.frames() if frame.t > END / 2]
        assert later[-1].step == n, later[-1].step
        exact = [np.array([f(frame.t) * shape for frame in later]) for f in (amplitude, rate)]
        ours = [np.array([frame.u for frame in later]), np.array([frame.v for frame in later])]
        found.append([np.linalg.norm(a - b) / np.linalg.norm(b) for a, b in zip(ours, exact)])
    return END / np.array(steps), np.array(found).T


def order_result(name, sizes, values, expected):
    order = float(fitted_order(sizes, values))
    return Result(name, excess(expected, order), 0.1, order, expected,
                  "errors " + ", ".join(f"{value:.2e}" for value in values))


def results(context):
    curves = {}
    for dim in (2,) if context.quick else (2, 3):
        for order in (1, 2):
            for name, law in laws(dim).items():
                sizes, (value, slope) = in_space(context, name, law, dim, order)
                curves[f"{dim}D P{order} {name}"] = sizes, value
                yield order_result(f"{dim}D, P{order}, {name}, L2 in space", sizes, value, order + 1)
                yield order_result(f"{dim}D, P{order}, {name}, H1 in space", sizes, slope, order)
    context.figure("space", lambda axes: draw(axes, curves, "element size / length", [(2, "order 2"), (3, "order 3")]))
    curves = {}
    for name, law in laws(2).items():
        for rule, expected, any_start in RULES:
            if context.quick and name != "neo-Hookean" and rule != "BDF2":
                continue
            steps = np.array([20, 40, 80]) * {1: 4, 2: 4, 5: 3, 6: 1.5}.get(expected, 2)
            sizes, (u, v) = in_time(context, name, law.scene[0], law, rule, any_start, steps)
            if name == "neo-Hookean":
                curves[rule] = sizes, u
            yield order_result(f"{rule}, {name}, displacement in time", sizes, u, expected)
            yield order_result(f"{rule}, {name}, velocity in time", sizes, v, expected)
    context.figure("time", lambda axes: draw(axes, curves, "time step [s]", []))
    law = laws(2)["neo-Hookean"]
    sizes, (u, _) = in_time(context, "neo-Hookean", law.scene[0], law, "ImplicitNewmark", True, [40, 80, 160], consistent=False)
    yield order_result("ImplicitNewmark from zero instead of the consistent acceleration, displacement", sizes, u, 1)


def draw(axes, curves, label, slopes):
    for name, (sizes, values) in curves.items():
        axes.loglog(sizes, values, "o-", label=name, markersize=3)
    for order, name in slopes:
        axes.loglog(sizes, values[-1] * (sizes / sizes[-1])**order, "k--", label=name)
    axes.set(xlabel=label, ylabel="error of displacement")
    axes.legend(fontsize=7)
