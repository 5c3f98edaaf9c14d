# SPDX-License-Identifier: MIT
"""Quarters of two equal elastic hemispheres, pressed onto each other by their flat sides: Hertz's contact in 3D."""
import h5py
import numpy as np
from harness.bisection import ball
from harness.contact import vertex_areas, with_contact
from harness.scenes import Frame, run_scene, scene, write_mesh
from harness.suite import Result, compare

TITLE = "Hertz contact in 3D"
QUANTITY = "force, radius by the second moment of the pressure, and peak of Hertz's pressure with both; the share of the force within a radius"
REFERENCE = "p0 = E / (pi (1 - nu^2)) sqrt(2 h / R), a = sqrt(R h / 2), p = p0 sqrt(1 - r^2 / a^2) (code_aster SSNV104)"
TOLERANCE = "finest: radius 1 %, force 2.5 %, peak 4 %, shares 0.1: four cells a radius, and hemispheres are no half-spaces"
NEEDS = ("meshio", "h5py")
QUICK = False

R, YOUNG, NU, APPROACH = 50.0, 20.0, 0.3, 0.04  # mm, GPa
RADIUS = np.sqrt(R * APPROACH / 2)
PEAK = YOUNG / (np.pi * (1 - NU**2)) * np.sqrt(2 * APPROACH / R)
FORCE = 2 / 3 * np.pi * RADIUS**2 * PEAK
DHAT = 1e-3 * APPROACH


def press(context, below, above):
    """The last state, with cells of these sizes, in radii of the contact, in the hemisphere below and above."""
    geometry = []
    for side, h in ((-1, below), (1, above)):
        size = lambda x: np.maximum(h * RADIUS, 0.35 * (np.linalg.norm(x - [0, 0, -side * R], axis=1) - RADIUS))
        points, cells = ball(R, size, [[1, 1, -side]])
        points[:, 2] += side * (R + DHAT / 2)
        mesh = context.folder / f"{below:g}-{above:g}{side:+d}.msh"
        write_mesh(mesh, points, cells)
        geometry.append({"mesh": str(mesh), "surface_selection": {"threshold": 1e-6, "id_offset": 10 if side > 0 else 0}})
    held = lambda tag, axis, value=0: {"id": tag, "value": [value if k == axis else 0 for k in range(3)],
                                       "dimension": [k == axis for k in range(3)]}
    # Half of the approach each, and of the gap, which closes.
    move = f"{(APPROACH + DHAT) / 2:.17g} * t"
    content = scene("", {"type": "LinearElasticity", "E": YOUNG, "nu": NU, "rho": 1.0},
                    boundary_conditions={"dirichlet_boundary": [held(1, 0), held(11, 0), held(2, 1), held(12, 1),
                                                                held(5, 2, move), held(16, 2, "-" + move)]},
                    time={"dt": 0.25, "tend": 1, "quasistatic": True}, output={"paraview": {"options": {"contact_forces": True}}})
    content["geometry"] = geometry
    content["solver"]["nonlinear"]["x_delta"] = 1e-9
    content["solver"]["linear"] = {"solver": ["cholmod", "eigen"]}
    run = run_scene(context, f"press-{below:g}-{above:g}", with_contact(content, DHAT, YOUNG))
    return State(run)


class State:
    """Of the upper hemisphere: radius and pressure by vertex, area that each stands for; of the whole contact: force, radius, peak."""

    def __init__(self, run):
        path = max((run.folder / "frames").glob("*.h5"))
        frame = Frame(path)
        with h5py.File(path) as file:
            force = file["fields/contact_force"][()][:, 2]
        on_sphere = np.isclose(np.linalg.norm(frame.rest - [0, 0, R + DHAT / 2], axis=1), R, rtol=1e-9)
        area = vertex_areas(frame.rest, frame.cells, on_sphere)
        here = on_sphere & (frame.rest[:, 2] < 0.05 * R)
        self.r = np.linalg.norm(frame.x[here, :2], axis=1)
        self.area, self.pressure = area[here], force[here] / area[here]
        self.force = 4 * float(force[here].sum())
        # The mean of r^2 over Hertz's pressure is 2/5 a^2.
        self.radius = float(np.sqrt(2.5 * (force[here] * self.r**2).sum() / force[here].sum()))
        self.peak = 1.5 * self.force / (np.pi * self.radius**2)
        self.vertices, self.seconds = len(frame.rest), sum(step["processor_seconds"] for step in run.steps)

    def shares(self):
        """Radii by Hertz's for this force, the share of the force within, and Hertz's share."""
        a = (3 * self.force * R * (1 - NU**2) / (4 * YOUNG))**(1 / 3)
        order = np.argsort(self.r)
        within = np.cumsum((self.area * self.pressure)[order]) * 4 / self.force
        # Half of a vertex's own force lies outside of its radius.
        within -= (self.area * self.pressure)[order] * 2 / self.force
        r = self.r[order] / a
        return r, within, 1 - np.maximum(0, 1 - r**2)**1.5


def results(context):
    sizes = [(0.5, 0.5), (0.35, 0.3), (0.35, 0.35), (0.25, 0.25)]
    for below, above in sizes:
        state = press(context, below, above)
        r, within, exact = state.shares()
        judged = (below, above) == sizes[-1]
        tolerance = lambda value: value if judged else None
        label = f"cells of {below} and {above} a"
        yield compare(f"{label}: peak pressure [GPa]", state.peak, PEAK, tolerance(0.04),
                      f"{state.vertices} vertices, {state.seconds:.0f} processor seconds")
        yield compare(f"{label}: radius [mm]", state.radius, RADIUS, tolerance(0.01))
        yield compare(f"{label}: force [kN]", state.force, FORCE, tolerance(0.025))
        yield Result(f"{label}: share of the force within a radius, largest difference", float(np.abs(within - exact).max()),
                     tolerance(0.1))
    context.figure("force", lambda axes: draw(axes, state))


def draw(axes, state):
    r, within, exact = state.shares()
    axes.plot(r, exact, "k--", label="Hertz")
    axes.plot(r, within, ".", markersize=3, label="ITR")
    axes.set(xlabel="r / a", ylabel="share of the force within r", xlim=(0, 1.5))
    axes.legend()
