# SPDX-License-Identifier: MIT
"""Two elastic bars that hit a rigid wall, whose motion is known exactly, by three integrators, on fixed and on remeshed meshes."""
import shutil

import h5py
import numpy as np
from harness.contact import gap_of_pressure, with_obstacle, write_line
from harness.fields import consistent_mass_product, fitted_order, gradients, volumes
from harness.scenes import box_mesh, run_scene, scene, write_mesh
from harness.suite import Result, compare, excess

TITLE = "Impacts with exact answers"
QUANTITY = ("begin and end of the pressure that has the force's mean and spread over time; impulse over the exact duration; displacement, "
            "L2 over bar and time; energy over periods")
REFERENCE = "d'Alembert: the bar that falls of Doyen, Ern & Piperno 2011; the bar that bounces of Dabaghi, Pousin & Renard 2014"
TOLERANCE = "contact times 1 %, mean pressures 2 %; energy never above its start by 0.1 % but by Newmark, whose drift is stated"
NEEDS = ("meshio", "h5py")

# Linear elasticity has no length of its own: these bars move a hundredth as far as the published ones, so that no cell turns over.
AMPLITUDE = 1e-2


class Bar:
    """Along x from its end at the wall, x = 0; held at its far end, stretched by half of itself away from the wall and let go."""
    name, length, young, wave_speed = "bar that bounces", 1.0, 1.0, 1.0
    begin, end, period = 1.0, 2.0, 3.0
    first_pressure, last_pressure = 0.5, 0.5
    conditions = {"boundary_conditions": {"dirichlet_boundary": [{"id": 3, "value": [0, 0]}]},
                  "initial_conditions": {"solution": [{"id": 1, "value": [f"{AMPLITUDE} * (1 - x) / 2", 0]}]}}
    energy = 0.125

    @staticmethod
    def exact(x, t):
        t = t % 3
        t = min(t, 3 - t)
        return (1 - np.maximum(x, t)) / 2 if t < 1 else -np.minimum(np.minimum(x, t - 1), 1 - x) / 2


class FallingBar(Bar):
    """Dropped from 5 m: it arrives with 10 m/s. Its motion is held against contact only."""
    name, length, young, wave_speed = "bar that falls", 10.0, 900.0, 30.0
    begin, end, period = 1.0, 5 / 3, 16 / 3
    first_pressure, last_pressure = 300.0, 500.0
    conditions = {"boundary_conditions": {"rhs": [10 * AMPLITUDE, 0]},
                  "initial_conditions": {"solution": [{"id": 1, "value": [5 * AMPLITUDE, 0]}]}}
    exact = None


def run(context, bar, integrator, cells, courant, dhat=2e-3, remesh=None, coarsest=1, periods=0):
    """A bar of so many cells, in steps of `courant` times what a wave takes through one; `dhat` by the length and amplitude.
    Until the first contact is over, or for so many periods. `remesh`: tolerance by the energy of a cell at the last pressure; edges up
    to `coarsest` cells may collapse."""
    width = bar.length / cells
    points, simplices = box_mesh([cells, 1], [bar.length, width])
    kappa, dhat = bar.last_pressure * AMPLITUDE, dhat * bar.length * AMPLITUDE
    # The two corners at the wall stand for twice the width: half of their edges is along the bar.
    gap = gap_of_pressure((bar.first_pressure + bar.last_pressure) / 4 * AMPLITUDE, dhat, kappa)
    name = f"{bar.__name__}-{integrator}-{cells}-{courant:g}-{dhat:g}-{remesh}-{coarsest}-{periods}"
    mesh, wall = context.folder / f"{name}.msh", context.folder / f"{name}.obj"
    write_mesh(mesh, points, simplices)
    write_line(wall, (-gap, -9 * bar.length), (-gap, 10 * bar.length))
    end = periods * bar.period or bar.end + 0.4 * (bar.end - bar.begin)
    steps = round(end * bar.wave_speed / (courant * width))
    content = scene(mesh, {"type": "LinearElasticity", "E": bar.young, "nu": 0, "rho": 1.0}, **bar.conditions,
                    time={"tend": end, "time_steps": steps, "integrator": integrator},
                    output={"paraview": {"options": {"contact_forces": True}}})
    content["solver"]["nonlinear"]["x_delta"] = 1e-9
    if remesh:
        energy = (bar.last_pressure * AMPLITUDE)**2 / (2 * bar.young) * bar.length * width  # of the bar at this pressure
        content["space"] = {"remesh": {"enabled": True, "split": {"acceptance_tolerance": remesh * energy},
                                       "collapse": {"acceptance_tolerance": -0.01 * remesh * energy, "rel_max_edge_length": coarsest}}}
    found = run_scene(context, name, with_obstacle(content, wall, dhat, kappa))
    return Motion(bar, found, cells, integrator, remesh, dhat / (bar.length * AMPLITUDE))


class Motion:
    """What a run did, in the published amplitude: times, pressure at the wall, energy, error of the displacement."""

    def __init__(self, bar, run, cells, integrator, remesh, dhat):
        self.bar, self.cells, self.integrator, self.remesh, self.dhat = bar, cells, integrator, remesh, dhat
        width, rows, squares = bar.length / cells, [], np.zeros(2)
        for path, frame in zip(sorted((run.folder / "frames").glob("*.h5")), run.frames()):
            with h5py.File(path) as file:
                pressure = file["fields/contact_force"][()][:, 0].sum() / width / AMPLITUDE
            slopes = gradients(frame.rest, frame.cells, frame.u)
            strain = (slopes + slopes.transpose(0, 2, 1)) / 2
            elastic = 0.5 * bar.young * volumes(frame.rest, frame.cells) @ (strain**2).sum(axis=(1, 2))
            kinetic = 0.5 * (frame.v * consistent_mass_product(frame.rest, frame.cells, 1.0, frame.v)).sum()
            rows.append((frame.t, pressure, (elastic + kinetic) / width / AMPLITUDE**2))
            if bar.exact:
                exact = bar.exact(frame.rest[:, 0], frame.t)
                squares += np.mean((frame.u[:, 0] / AMPLITUDE - exact)**2), np.mean(exact**2)
        self.t, self.pressure, self.energy = np.array(rows).T
        self.error = float(np.sqrt(squares[0] / squares[1])) if bar.exact else None
        self.vertices, self.seconds = run.steps[-1]["vertices"], sum(step["processor_seconds"] for step in run.steps)
        shutil.rmtree(run.folder)  # a file a step

    def row(self, series):
        number = lambda x: "" if x is None else f"{x:.5g}"
        return [series, self.bar.name, self.integrator, number(self.remesh), self.cells, len(self.t) - 1, number(self.dhat), self.vertices,
                *map(number, (*self.first_contact(), self.error, self.seconds))]

    def first_contact(self):
        """Begin, end and mean of the pressure of the exact shape (linear in time) that has the impulse of this one, and its mean and
        spread over time. Forces of the ends of steps act over the steps."""
        bar, inside = self.bar, self.t[1:] < self.bar.end + 0.5 * (self.bar.end - self.bar.begin)
        weight = (np.diff(self.t) * self.pressure[1:])[inside]
        middle = ((self.t[1:] + self.t[:-1]) / 2)[inside]
        impulse = weight.sum()
        mean = weight @ middle / impulse
        spread = np.sqrt(weight @ (middle - mean)**2 / impulse)
        p, q = bar.first_pressure, bar.last_pressure
        shape_mean = (p + 2 * q) / (3 * (p + q))
        shape_spread = np.sqrt((p + 3 * q) / (6 * (p + q)) - shape_mean**2)
        duration = spread / shape_spread
        begin = mean - shape_mean * duration
        return float(begin), float(begin + duration), float(impulse / (bar.end - bar.begin))


def judge(label, motion, judged=True):
    bar = motion.bar
    begin, end, pressure = motion.first_contact()
    note = f"{motion.vertices} vertices at the end"
    if motion.error is not None:
        note += f"; displacement {motion.error:.2e} off in L2"
    yield compare(f"{label}: contact begins [s]", begin, bar.begin, 0.01 if judged else None)
    yield compare(f"{label}: contact ends [s]", end, bar.end, 0.01 if judged else None)
    yield compare(f"{label}: mean pressure [Pa]", pressure, (bar.first_pressure + bar.last_pressure) / 2, 0.02 if judged else None, note)


# Integrator: cells, Courant number. An end of the bar goes on with half a cell's mass, which is first order in the cell; steps of
# implicit Euler are to be much shorter still, for it smears a jump over sqrt(dt t).
INTEGRATORS = {"ImplicitEuler": (100, 0.02), "BDF2": (100, 0.1), "ImplicitNewmark": (100, 0.5)}


def results(context):
    runs = []
    for bar in (Bar, FallingBar):
        for integrator, (cells, courant) in INTEGRATORS.items():
            if context.quick and (integrator == "ImplicitEuler" or bar is FallingBar and integrator == "BDF2"):
                continue
            cells = cells if bar is Bar or context.quick else cells // 2  # the falling one takes 2.4 times the steps
            runs.append(run(context, bar, integrator, cells, courant))
            yield from judge(f"{bar.name}, {integrator}", runs[-1])
            if not context.quick and (bar is Bar or integrator != "ImplicitEuler"):
                runs.append(run(context, bar, integrator, cells, courant, remesh=1e-4))
                yield from judge(f"{bar.name}, {integrator}, remeshed", runs[-1])
    if context.quick:
        return
    # Waves fill the bar: coarsening forgets them.
    for start, coarsest in ((50, 1), (50, 3)):
        runs.append(run(context, Bar, "ImplicitNewmark", start, 0.25, remesh=1e-4, coarsest=coarsest))
        yield from judge(f"bar that bounces, ImplicitNewmark, remeshed from {start} cells, edges collapsed up to {coarsest} of them",
                         runs[-1], judged=False)
    yield from over_periods(context)
    series = list(by_one(context))
    for integrator in INTEGRATORS:
        sizes, errors = np.array([(1 / m.cells, m.error) for label, m in series if label == f"{integrator}, cells"]).T
        order = float(fitted_order(sizes, errors))
        bar = None if integrator == "ImplicitEuler" else 0.0  # at these steps it has damped most of what waves there are
        yield Result(f"bar that bounces, {integrator}: order of the displacement in the element size at one Courant number",
                     excess(0.6, order), bar, order, 2 / 3, "errors " + ", ".join(f"{e:.2e}" for e in errors) + "; velocities jump")
    context.table("runs", ["series", "bar", "integrator", "remeshed", "cells", "steps", "dhat / length / amplitude", "vertices", "begin",
                           "end", "mean pressure", "displacement L2", "processor seconds"],
                  [motion.row("times") for motion in runs] + [motion.row(label.split(", ")[1]) for label, motion in series])
    context.figure("errors", lambda axes: draw_errors(axes, series))


def by_one(context):
    """The bar that bounces over a period where one thing changes: pairs of a label and its motion."""
    for integrator, (_, courant) in INTEGRATORS.items():
        motion_of = lambda cells=25, share=1, dhat=2e-3: run(context, Bar, integrator, cells, max(courant, 0.1) * share, dhat=dhat, periods=1)
        common = motion_of()
        for cells in (25, 50, 100):
            yield f"{integrator}, cells", common if cells == 25 else motion_of(cells=cells)
        for share in (4, 2, 1):
            yield f"{integrator}, dt", common if share == 1 else motion_of(share=share)
        for dhat in (8e-2, 2e-2, 2e-3):
            yield f"{integrator}, dhat", common if dhat == 2e-3 else motion_of(dhat=dhat)


def over_periods(context):
    """Energy of the bar that bounces."""
    periods, motions = 10, []
    for integrator in INTEGRATORS:
        motion = run(context, Bar, integrator, 25, 0.4, periods=periods)
        motions.append(motion)
        free = np.abs(motion.pressure) == 0  # in contact the barrier has a share
        energy = motion.energy[free] / Bar.energy
        bar = None if integrator == "ImplicitNewmark" else 1e-3
        yield Result(f"energy above its start, {integrator}, {periods} periods", excess(float(energy.max()), 1.0), bar,
                     float(energy[-1] * Bar.energy), Bar.energy, "value: at the last time out of contact [J]")
    context.figure("energy", lambda axes: draw_energy(axes, motions))


def draw_energy(axes, motions):
    for motion in motions:
        axes.plot(motion.t / Bar.period, motion.energy / Bar.energy, label=motion.integrator)
    axes.set(xlabel="periods", ylabel="energy / initial, without the barrier's")
    axes.legend()


def draw_errors(axes, series):
    styles = {"cells": "o-", "dt": "s--", "dhat": "^:"}
    for k, integrator in enumerate(INTEGRATORS):
        for what, style in styles.items():
            motions = [motion for label, motion in series if label == f"{integrator}, {what}"]
            x = {"cells": lambda m: 1 / m.cells, "dt": lambda m: m.t[1], "dhat": lambda m: m.dhat}[what]
            axes.loglog([x(m) for m in motions], [m.error for m in motions], f"C{k}{style}", markersize=4, label=f"{integrator}, {what}")
    axes.set(xlabel="element size at one Courant number, dt, dhat (of the length, period, amplitude)", ylabel="displacement, L2 error")
    axes.legend(fontsize=6)
