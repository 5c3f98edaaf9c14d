# SPDX-License-Identifier: MIT
"""A cylinder pressed onto a rigid plane (plane strain): Hertz's line contact."""
import numpy as np
from harness.contact import vertex_lengths, with_obstacle, write_line
from harness.fields import fitted_order, gradients, volumes
from harness.materials import lame
from harness.scenes import box_mesh, oriented, run_scene, scene, write_mesh
from harness.suite import Result, excess

TITLE = "Hertz contact in 2D"
QUANTITY = "pressure along the contact against Hertz's for the same force, L2 over its peak; peak and half-width"
REFERENCE = "p = p0 sqrt(1 - x^2 / a^2), a = sqrt(4 F R (1 - nu^2) / (pi E)), p0 = 2 F / (pi a)"
TOLERANCE = ("finest mesh: pressure 3 % in L2, 0.5 % within 0.9 a, peak 0.5 %, half-width 2 %; order 1 in element size "
             "and of the force in dhat; 1 % + 10 dhat / m at each dhat")
NEEDS = ("meshio", "h5py")

R, YOUNG, NU, APPROACH = 1.0, 1e6, 0.3, 2e-3
HALF_WIDTH = 0.8  # of the body, whose sides are free and whose top is pushed


def body(n):
    """2 n x n cells between the circle's lower arc and a flat top, fine near the lowest point (0, 0)."""
    st, cells = box_mesh([2 * n, n], [2.0, 1.0])
    s, t = st[:, 0] - 1, st[:, 1]
    grade = lambda s: np.sign(s) * (0.1 * np.abs(s) + 0.9 * np.abs(s)**7)
    x = HALF_WIDTH * grade(s)
    arc = R - np.sqrt(R**2 - x**2)
    points = np.stack([x, arc + grade(t) * (R - arc)], axis=1)
    return points, oriented(points, cells)


def nodal_forces(frame):
    """Internal forces of linear elasticity in plane strain."""
    mu, lmbda = lame(YOUNG, NU, 2, plane_strain=True)
    slopes = gradients(frame.rest, frame.cells, frame.u)
    strain = (slopes + slopes.transpose(0, 2, 1)) / 2
    stress = 2 * mu * strain + lmbda * np.trace(strain, axis1=1, axis2=2)[:, None, None] * np.eye(2)
    edges = frame.rest[frame.cells[:, 1:]] - frame.rest[frame.cells[:, :1]]
    shape = np.linalg.inv(edges).transpose(0, 2, 1)  # gradients of the shape functions of corners 1 and 2
    shape = np.concatenate([-shape.sum(axis=1, keepdims=True), shape], axis=1)
    forces = np.zeros_like(frame.u)
    np.add.at(forces, frame.cells, volumes(frame.rest, frame.cells)[:, None, None] * np.einsum("mij,mkj->mki", stress, shape))
    return forces


def press(context, n, dhat, approach=APPROACH):
    points, cells = body(n)
    mesh, plane = context.folder / f"body-{n}.msh", context.folder / "plane.obj"
    write_mesh(mesh, points, cells)
    write_line(plane, (-9, -dhat), (10, -dhat))
    content = scene(mesh, {"type": "LinearElasticity", "E": YOUNG, "nu": NU, "rho": 1.0, "plane_strain": True},
                    boundary_conditions={"dirichlet_boundary": [{"id": 4, "value": [0, f"{-(approach + dhat)} * t"]}]},
                    time={"dt": 0.1, "tend": 1, "quasistatic": True})
    content["geometry"][0]["surface_selection"] = [{"id": 4, "box": [[-2, R - 1e-6], [2, R + 1e-6]]}]
    content["solver"]["nonlinear"]["x_delta"] = 1e-10
    run = run_scene(context, f"press-{n}-{dhat:g}-{approach:g}", with_obstacle(content, plane, dhat, YOUNG))
    # The edge of the contact moves over the cells: an average of several states does not depend on where in a cell it is.
    return [pressures(frame) for frame in run.frames() if frame.t > 0.45]


def pressures(frame):
    """x and pressure along the arc, and the force on it."""
    points = frame.rest
    forces = nodal_forces(frame)
    arc = np.flatnonzero(np.isclose(points[:, 1], R - np.sqrt(R**2 - points[:, 0]**2)) & (np.abs(points[:, 0]) < 0.4))
    arc = arc[np.argsort(points[arc, 0])]
    x = points[arc, 0] + frame.u[arc, 0]
    return x, forces[arc, 1] / vertex_lengths(frame.rest, frame.cells)[arc], forces[arc, 1].sum()


def compare(x, pressure, force):
    a = np.sqrt(4 * force * R * (1 - NU**2) / (np.pi * YOUNG))
    peak = 2 * force / (np.pi * a)
    exact = peak * np.sqrt(np.maximum(0, 1 - x**2 / a**2))
    width = np.gradient(x)
    error = np.sqrt((width * (pressure - exact)**2).sum() / (width * exact**2).sum())
    # The half-width from the second moment: a^2 / 4 of Hertz's pressure.
    found = 2 * np.sqrt((width * pressure * x**2).sum() / (width * pressure).sum())
    inside = np.abs(x) < 0.9 * a
    square = lambda values: (width * values**2)[inside].sum()
    return {"L2": error, "L2 inside": np.sqrt(square(pressure - exact) / square(exact)),
            "inside": np.abs(pressure - exact)[inside].max() / peak, "a": a, "peak": peak, "found": found, "exact": exact,
            "force": force}


def results(context):
    sizes = [12, 24, 48] if context.quick else [12, 24, 48, 80]
    smallest = 1e-5
    series = [(n, press(context, n, smallest)) for n in sizes]
    found = [[compare(*state) for state in states] for _, states in series]
    mean = lambda states, key: float(np.sqrt(np.mean([state[key]**2 for state in states])))
    errors = [mean(states, "L2") for states in found]
    listed = lambda values: "errors " + ", ".join(f"{value:.2e}" for value in values)
    # The square root at the contact's edge: piecewise linear fields come as near as h sqrt(log(a / h)).
    cell = HALF_WIDTH * 0.1 / np.array(sizes)
    order = float(fitted_order(cell, errors / np.sqrt(np.log(found[-1][-1]["a"] / cell))))
    yield Result("order of the pressure's L2 error in element size, but for sqrt(log(a / h))", excess(1, order), 0.2, order, 1,
                 listed(errors) + f" with {', '.join(str(2 * n) for n in sizes)} cells along")
    (x, pressure, _), last = series[-1][1][-1], found[-1][-1]
    yield Result("pressure on the finest mesh, L2", errors[-1], 3e-2)
    # Hertz's formula is the limit of small contacts. At a / R = 0.03 it is 0.6 to 0.9 % off near the edge, and the finest mesh
    # shows that; the same mesh with half of the contact is nearer to the limit.
    inside = found[-1] if context.quick else [compare(*state) for state in press(context, sizes[-1], smallest / 4, APPROACH / 4)]
    yield Result("pressure on the finest mesh, largest within 0.9 a over the peak", mean(inside, "inside"), 5e-3,
                 note=f"a / R = {inside[-1]['a'] / R:.3f}")
    yield Result("peak pressure [Pa]", abs(pressure.max() / last["peak"] - 1), 5e-3, float(pressure.max()), float(last["peak"]))
    yield Result("half-width [m]", abs(last["found"] / last["a"] - 1), 2e-2, float(last["found"]), float(last["a"]))
    context.figure("pressure", lambda axes: draw(axes, x / last["a"], pressure / last["peak"], last["exact"] / last["peak"]))
    yield from by_gap(context, found[1], smallest)


def by_gap(context, at_smallest, smallest):
    """On one mesh: what the mesh leaves of the error stays, what the gap adds goes with dhat."""
    gaps = [1e-3, 3e-4, 1e-4, 3e-5]
    states = [[compare(*state) for state in press(context, 24, dhat)] for dhat in gaps] + [at_smallest]
    gaps.append(smallest)
    for dhat, found in zip(gaps, states):
        error = float(np.sqrt(np.mean([state["L2 inside"]**2 for state in found])))
        yield Result(f"dhat = {dhat:g} m: pressure within 0.9 a, L2", error, 1e-2 + 10 * dhat)
    forces = [float(np.mean([state["force"] for state in found])) for found in states]
    order = float(fitted_order(-np.diff(gaps), -np.diff(forces)))
    yield Result("order of the force for one approach in dhat", abs(order - 1), 0.05, order, 1,
                 "forces " + ", ".join(f"{force:.1f}" for force in forces) + " N for dhat " + ", ".join(f"{g:g}" for g in gaps))


def draw(axes, x, pressure, exact):
    axes.plot(x, exact, "k--", label="Hertz")
    axes.plot(x, pressure, ".-", label="ITR")
    axes.set(xlabel="x / a", ylabel="p / p0", xlim=(-1.5, 1.5))
    axes.legend()
