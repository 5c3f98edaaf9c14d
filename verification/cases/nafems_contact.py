# SPDX-License-Identifier: MIT
"""Half of a steel cylinder pressed onto half of an aluminium block, plane strain, St. Venant-Kirchhoff, the block's foot clamped: the
first of NAFEMS' contact benchmarks, on ever finer uniform meshes and remeshed from a coarse one. Lengths in mm, stresses in MPa."""
import h5py
import numpy as np
from harness.bisection import ball, graded_mesh
from harness.contact import boundary_edges, with_contact
from harness.scenes import Frame, run_scene, scene, write_mesh
from harness.suite import Result, compare

TITLE = "NAFEMS contact benchmark 1: cylinder on a block"
QUANTITY = "how far the block's top sinks under the cylinder; peak pressure without friction; unknowns and seconds for 1 %"
REFERENCE = ("1.30264 mm by quadratic elements (code_aster V6.03.154; Konter 2006); Hertz's peak pressure, "
             "sqrt(F E* / (pi R)) = 3 585 MPa, the limit of small contacts")
TOLERANCE = "finest: 1 % of the displacement; pressure 2 %"
NEEDS = ("meshio", "h5py")

R, SIDE, FORCE = 50.0, 100.0, 17500.0  # halves: the symmetry plane is x = 0
STEEL, ALUMINIUM, NU = 210000.0, 70000.0, 0.3
SINKS = 1.30264
E_STAR = 1 / ((1 - NU**2) * (1 / STEEL + 1 / ALUMINIUM))
PEAK, HALF_WIDTH = np.sqrt(2 * FORCE * E_STAR / (np.pi * R)), np.sqrt(8 * FORCE * R / (np.pi * E_STAR))
DHAT = 1e-3


def meshes(h, h_arc):
    """Of block and cylinder, with cells of size h; where the cylinder touches, h_arc."""
    corners = [(0, 0), (SIDE, 0), (0, -SIDE), (SIDE, -SIDE), (0, -2 * SIDE), (SIDE, -2 * SIDE)]
    yield graded_mesh(corners, [(0, 1, 2), (1, 2, 3), (2, 3, 4), (3, 4, 5)], lambda x: np.full(len(x), h))
    away = lambda x: np.linalg.norm(x - [0, -R], axis=1)
    points, cells = ball(R, lambda x: np.minimum(h, np.maximum(h_arc, 0.7 * (away(x) - 1.5 * HALF_WIDTH))), [[1, 1], [1, -1]])
    yield points + [0, R + 0.5 * DHAT], cells


def press(context, name, h, h_arc, friction=0.1, tolerance=None):
    geometry, top = [], 2 * R
    for k, (points, cells) in enumerate(meshes(h, h_arc)):
        mesh = context.folder / f"{name}-{k}.msh"
        write_mesh(mesh, points, cells, np.full(len(cells), k + 1))
        geometry.append({"mesh": str(mesh), "surface_selection": {"threshold": 1e-6, "id_offset": 10 * k}})
    # The force on the cylinder's highest facets, away from what is looked at.
    edges = boundary_edges(cells)
    places, lengths = points[edges].mean(axis=1), np.linalg.norm(points[edges[:, 0]] - points[edges[:, 1]], axis=1)
    pushed = (places[:, 1] > top - 2) & (places[:, 0] > 1e-6)
    geometry[1]["surface_selection"] = [{"id": 20, "box": [[1e-6, top - 2], [SIDE, top + 1]]}, {"id": 11, "box": [[-1, -1], [1e-6, top + 1]]}]
    content = scene("", [{"id": k + 1, "type": "SaintVenant", "E": young, "nu": NU, "rho": 1.0, "plane_strain": True}
                         for k, young in enumerate((ALUMINIUM, STEEL))],
                    boundary_conditions={
                        "dirichlet_boundary": [{"id": 2, "value": [0, 0]},
                                               *({"id": tag, "value": [0, 0], "dimension": [True, False]} for tag in (1, 11))],
                        "neumann_boundary": [{"id": 20, "value": [0, f"{-FORCE / lengths[pushed].sum():.17g} * t"]}]},
                    time={"dt": 0.25, "tend": 1, "quasistatic": True}, output={"paraview": {"options": {"contact_forces": True}}})
    content["geometry"] = geometry
    content["solver"]["nonlinear"]["x_delta"] = 1e-8
    if tolerance:
        content["space"] = {"remesh": {"enabled": True, "split": {"acceptance_tolerance": tolerance},
                                       "collapse": {"acceptance_tolerance": -0.01 * tolerance}}}
    run = run_scene(context, name, with_contact(content, DHAT, ALUMINIUM, friction_coefficient=friction, epsv=1e-4))
    return State(run)


class State:
    """How far the block's top at the axis has sunk; half-width of the contact by the second moment of the force, and the peak of
    Hertz's pressure with both; what they cost."""

    def __init__(self, run):
        path = max((run.folder / "frames").glob("*.h5"))
        frame = Frame(path)
        with h5py.File(path) as file:
            force = file["fields/contact_force"][()][:, 1]
        self.sinks = float(-frame.u[np.flatnonzero((frame.rest == 0).all(axis=1))[0], 1])
        up = force > 0  # of the cylinder
        self.force = float(force[up].sum())
        self.half_width = float(2 * np.sqrt((force[up] * frame.x[up, 0]**2).sum() / self.force))
        self.peak = 4 * self.force / (np.pi * self.half_width)
        self.unknowns, self.seconds = run.steps[-1]["unknowns"], sum(step["processor_seconds"] for step in run.steps)
        self.error = abs(self.sinks / SINKS - 1)
        self.note = f"{self.unknowns} unknowns, {self.seconds:.2f} processor seconds; half-width {self.half_width:.3f} mm"


def results(context):
    series = {"uniform": [press(context, f"uniform-{h:g}", h, h) for h in ((8, 4) if context.quick else (8, 5.6, 4, 2.8, 2))],
              "remeshed": [press(context, f"remeshed-{tolerance:g}", 16, 1, tolerance=tolerance)
                           for tolerance in ((0.3,) if context.quick else (10, 3, 1, 0.3, 0.1))]}
    for name, states in series.items():
        for state in states:
            yield compare(f"{name}: block's top [mm]", state.sinks, SINKS, 0.01 if state is states[-1] else None, state.note)
        reached = next((state for state in states if state.error <= 0.01), None)
        if reached:
            yield Result(f"{name}: error where it is first below 1 %", reached.error, 0.01, note=reached.note)
    if not context.quick:
        smooth = press(context, "frictionless", 2, 1, friction=0)
        yield compare("frictionless: block's top [mm]", smooth.sinks, SINKS, None, smooth.note)
        # Hertz's formula is of small strains and a flat contact, here are strains of 5 % and an eighth of the radius: on meshes of half
        # the size the peak is 2.1 % off. On this one 2 % leaves a quarter for what the code does.
        yield compare("frictionless: peak pressure [MPa]", smooth.peak, PEAK, 0.02)
        yield compare("force through the contact [N/mm]", smooth.force, FORCE, 1e-6)
    context.table("runs", ["series", "unknowns", "processor seconds", "sinks", "half-width", "peak"],
                  [[name, s.unknowns, *(f"{x:.6g}" for x in (s.seconds, s.sinks, s.half_width, s.peak))]
                   for name, states in series.items() for s in states])
    context.figure("error", lambda axes: draw(axes, series))


def draw(axes, series):
    for name, states in series.items():
        axes.loglog([s.unknowns for s in states], [s.error for s in states], "o-", label=name)
    axes.axhline(0.01, color="k", linewidth=0.5)
    axes.set(xlabel="unknowns", ylabel="block's top, off the published value")
    axes.legend()
