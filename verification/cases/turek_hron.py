# SPDX-License-Identifier: MIT
"""Turek & Hron's elastic beam behind a cylinder, structure alone: at rest in gravity (CSM1) and swinging in it (CSM3)."""
import numpy as np
from harness.fields import fitted_order
from harness.scenes import box_mesh, oriented, run_scene, scene, write_mesh
from harness.suite import Result, excess

TITLE = "Turek-Hron benchmark, CSM1 and CSM3"
QUANTITY = "displacement of the beam's tip: at rest, extrapolated over meshes; mean, amplitude and frequency of its swing"
REFERENCE = "featflow.de, 251 448 unknowns (CSM1); Turek & Hron 2006 (CSM3)"
TOLERANCE = "CSM1 0.2 % extrapolated, finest mesh 1 %; CSM3 1 %, extrapolated"
NEEDS = ("meshio", "h5py")

MU, NU, RHO, GRAVITY = 0.5e6, 0.4, 1000.0, 2.0
STATIC = (-7.1878e-3, -66.103e-3)
SWING = {"x": (-14.305e-3, 14.305e-3), "y": (-63.607e-3, 65.160e-3)}  # mean, amplitude
FREQUENCY = 1.0995


def beam(n):
    """n cells across the beam's 0.02 m, from the cylinder's arc to x = 0.6 m."""
    st, cells = box_mesh([round(17.5 * n), n], [1.0, 0.02])
    y = 0.19 + st[:, 1]
    left = 0.2 + np.sqrt(0.05**2 - (y - 0.2)**2)
    return np.stack([left + st[:, 0] * (0.6 - left), y], axis=1), cells


def run(context, n, **parts):
    points, cells = beam(n)
    mesh = context.folder / f"beam{n}.msh"
    write_mesh(mesh, points, oriented(points, cells))
    material = {"type": "SaintVenant", "E": 2 * MU * (1 + NU), "nu": NU, "rho": RHO, "plane_strain": True}
    content = scene(mesh, material, **parts)
    content["geometry"][0]["surface_selection"] = [{"id": 1, "center": [0.2, 0.2], "radius": 0.05}]
    content["solver"]["nonlinear"]["x_delta"] = 1e-9
    tip = np.flatnonzero(np.isclose(points[:, 0], 0.6) & np.isclose(points[:, 1], 0.2))[0]
    kind = "static" if parts["time"].get("quasistatic") else "swing"
    return run_scene(context, f"{kind}-{n}", content), tip


def results(context):
    clamped = [{"id": 1, "value": [0, 0]}]
    sizes = [8, 16, 32] if context.quick else [16, 32, 64]
    tips = []
    for n in sizes:
        done, tip = run(context, n, boundary_conditions={"rhs": [0, f"{GRAVITY} * t"], "dirichlet_boundary": clamped},
                        time={"dt": 0.2, "tend": 1, "quasistatic": True})
        tips.append(done.last().u[tip])
    tips = np.array(tips)
    for axis, name in enumerate("xy"):
        values = tips[:, axis]
        ratio = (values[1] - values[0]) / (values[2] - values[1])
        limit = values[2] + (values[2] - values[1]) / (ratio - 1)
        error = lambda value: abs(value / STATIC[axis] - 1)
        yield Result(f"CSM1, tip {name} extrapolated [m]", float(error(limit)), 2e-3, float(limit), STATIC[axis],
                     f"order {np.log2(ratio):.2f} over {sizes} cells across")
        if not context.quick:
            yield Result(f"CSM1, tip {name} on the finest mesh [m]", float(error(values[2])), 1e-2, float(values[2]), STATIC[axis])
        yield Result(f"CSM1, order of tip {name}",
                     excess(2, float(fitted_order(1 / np.array(sizes), np.abs(values - STATIC[axis])))), 0.2)
    if not context.quick:
        yield from swing(context, clamped)


def swing(context, clamped):
    """Mean, amplitude and frequency of the last period, extrapolated over two meshes at P1's order 2 (the static order)."""
    found = []
    for n in (16, 32):
        done, tip = run(context, n, boundary_conditions={"rhs": [0, GRAVITY], "dirichlet_boundary": clamped},
                        initial_conditions={"acceleration": "consistent"},
                        time={"dt": 0.01, "tend": 4.0, "integrator": "ImplicitNewmark"})
        t, u = (np.array(column) for column in zip(*((frame.t, frame.u[tip]) for frame in done.frames())))
        found.append(swing_of(t, u))
    limit = (4 * np.array(found[1]) - np.array(found[0])) / 3
    for axis, name in enumerate("xy"):
        for k, word in enumerate(("mean", "amplitude")):
            value, reference = float(limit[axis, k]), SWING[name][k]
            yield Result(f"CSM3, tip {name}, {word} [m]", abs(value / reference - 1), 1e-2, value, reference)
    frequency = float(limit[1, 2])
    yield Result("CSM3, frequency [Hz]", abs(frequency / FREQUENCY - 1), 1e-2, frequency, FREQUENCY)
    context.figure("tip", lambda axes: draw(axes, t, u))


def swing_of(t, u):
    """For x and y: mean, amplitude, frequency. Periods are counted where y passes its mean upwards."""
    middle = (u.max(axis=0) + u.min(axis=0)) / 2
    y = u[:, 1] - middle[1]
    k = np.flatnonzero((y[:-1] < 0) & (y[1:] >= 0))
    crossings = t[k] - y[k] * (t[k + 1] - t[k]) / (y[k + 1] - y[k])
    frequency = (len(crossings) - 1) / (crossings[-1] - crossings[0])
    last = t > t[-1] - 1 / frequency
    high, low = u[last].max(axis=0), u[last].min(axis=0)
    return [((high[a] + low[a]) / 2, (high[a] - low[a]) / 2, frequency) for a in (0, 1)]


def draw(axes, t, u):
    for axis, name in enumerate("xy"):
        axes.plot(t, u[:, axis], label=f"tip {name}")
    axes.set(xlabel="t [s]", ylabel="displacement [m]")
    axes.legend()
