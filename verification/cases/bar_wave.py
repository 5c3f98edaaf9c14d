# SPDX-License-Identifier: MIT
"""A clamped bar (nu = 0, so one-dimensional) that a traction pulls from t = 0 on."""
import numpy as np
from harness.scenes import box_mesh, run_scene, scene, write_mesh
from harness.suite import Result, compare

TITLE = "Wave in a bar"
QUANTITY = "wave speed from the arrival at the middle; speed behind the front; tip displacement over a period"
REFERENCE = "d'Alembert: c = sqrt(E / rho), the free end reaches twice the static displacement at t = 2 L / c"
TOLERANCE = "on 400 cells: wave speed 3e-6, particle speed 4e-6; tip 5e-4 in L2, its largest value 2.5e-3"
NEEDS = ("meshio", "h5py")

E, RHO, LENGTH, STRESS = 1e6, 100.0, 1.0, 10.0  # strain 1e-5: linear
SPEED = np.sqrt(E / RHO)


def results(context):
    n = 100 if context.quick else 400
    h = LENGTH / SPEED / n / 2
    steps = round(4 * LENGTH / SPEED / h)
    for dim in (2,) if context.quick else (2, 3):
        cells_across = [1] * (dim - 1)
        points, cells = box_mesh([n, *cells_across], [LENGTH] + [LENGTH / n] * (dim - 1))
        mesh = context.folder / f"bar{dim}.msh"
        write_mesh(mesh, points, cells)
        zero = [0] * (dim - 1)
        content = scene(mesh, {"type": "NeoHookean", "E": E, "nu": 0, "rho": RHO},
                        boundary_conditions={"dirichlet_boundary": [{"id": 1, "value": [0, *zero]}],
                                             "neumann_boundary": [{"id": 3, "value": [STRESS, *zero]}]},
                        initial_conditions={"acceleration": "consistent"},
                        time={"dt": h, "time_steps": steps, "integrator": "ImplicitNewmark"})
        content["solver"]["nonlinear"]["x_delta"] = 1e-8
        run = run_scene(context, f"bar{dim}", content)
        tip, middle = np.isclose(points[:, 0], LENGTH), np.isclose(points[:, 0], LENGTH / 2)
        t, at_tip, at_middle = np.array([(f.t, f.u[tip, 0].mean(), f.u[middle, 0].mean()) for f in run.frames()]).T
        # Behind the front particles move at one speed until the reflection comes: the line through their displacement starts
        # at the arrival. Its fit does not see how far numerical dispersion has spread the front.
        between = (t > 0.75 * LENGTH / SPEED) & (t < 1.25 * LENGTH / SPEED)
        particle_speed, offset = np.polyfit(t[between], at_middle[between], 1)
        arrival = -offset / particle_speed
        note = f"{n} cells along the bar"
        coarser = 400 / n  # errors grow with powers that coarser meshes showed
        yield compare(f"{dim}D wave speed [m/s]", float(LENGTH / 2 / arrival), float(SPEED), 3e-6 * coarser**2, note)
        yield compare(f"{dim}D particle speed behind the front [m/s]", float(particle_speed), STRESS / (RHO * SPEED),
                      4e-6 * coarser**1.5)
        static = STRESS * LENGTH / E
        exact = 2 * static * (1 - np.abs(1 - t * SPEED / (2 * LENGTH)))
        yield Result(f"{dim}D tip displacement, L2 in time", float(np.linalg.norm(at_tip - exact) / np.linalg.norm(exact)),
                     5e-4 * coarser)
        yield compare(f"{dim}D largest tip displacement [m]", float(at_tip.max()), 2 * static, 2.5e-3 * coarser**0.65)
        if dim == 2:
            context.figure("tip", lambda axes: draw(axes, t * SPEED / LENGTH, at_tip / static, exact / static))


def draw(axes, t, ours, exact):
    axes.plot(t, exact, "k--", label="d'Alembert")
    axes.plot(t, ours, label="ITR, Newmark")
    axes.set(xlabel="t c / L", ylabel="tip displacement / static")
    axes.legend()
