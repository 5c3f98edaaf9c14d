# SPDX-License-Identifier: MIT
"""Two elastic bars that hit a rigid wall, whose motion is known exactly, by three integrators, with and without remeshing."""
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
    energy = 10 * 10 * 5.0
    exact = None


def run(context, bar, integrator, cells, courant, dhat=2e-3, remesh=False, periods=0):
    """A bar of so many cells, in steps of `courant` times what a wave takes through one; `dhat` by the length and amplitude.
    Until the first contact is over, or for so many periods."""
    width = bar.length / cells
    points, simplices = box_mesh([cells, 1], [bar.length, width])
    kappa, dhat = bar.last_pressure * AMPLITUDE, dhat * bar.length * AMPLITUDE
    # The two corners at the wall stand for twice the width: half of their edges is along the bar.
    gap = gap_of_pressure((bar.first_pressure + bar.last_pressure) / 4 * AMPLITUDE, dhat, kappa)
    name = f"{bar.__name__}-{integrator}-{cells}-{courant:g}-{dhat:g}-{remesh}-{periods}"
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
        content["space"] = {"remesh": {"enabled": True, "split": {"acceptance_tolerance": 1e-5 * energy},
                                       "collapse": {"acceptance_tolerance": -1e-7 * energy, "rel_max_edge_length": 3}}}
    return Motion(bar, run_scene(context, name, with_obstacle(content, wall, dhat, kappa)), width)


class Motion:
    """What a run did, in the published amplitude: times, pressure at the wall, energy, error of the displacement."""

    def __init__(self, bar, run, width):
        self.bar, rows, squares = bar, [], np.zeros(2)
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
        self.vertices = run.steps[-1]["vertices"]

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


def judge(label, motion):
    bar = motion.bar
    begin, end, pressure = motion.first_contact()
    note = f"{motion.vertices} vertices at the end"
    if motion.error is not None:
        note += f"; displacement {motion.error:.2e} off in L2"
    yield compare(f"{label}: contact begins [s]", begin, bar.begin, 0.01)
    yield compare(f"{label}: contact ends [s]", end, bar.end, 0.01)
    yield compare(f"{label}: mean pressure [Pa]", pressure, (bar.first_pressure + bar.last_pressure) / 2, 0.02, note)


# Integrator, cells, Courant number: what each needs for 1 %. Implicit Euler smears a jump over sqrt(dt t).
INTEGRATORS = {"ImplicitEuler": (50, 0.01), "BDF2": (100, 0.1), "ImplicitNewmark": (100, 0.5)}


def results(context):
    for bar in (Bar, FallingBar):
        for integrator, (cells, courant) in INTEGRATORS.items():
            for remesh in (False, True):
                if context.quick and (remesh or integrator == "ImplicitEuler"):
                    continue
                # Remeshing starts from half of the cells.
                motion = run(context, bar, integrator, cells // 2 if remesh else cells, courant * (0.5 if remesh else 1), remesh=remesh)
                yield from judge(f"{bar.name}, {integrator}{', remeshed' if remesh else ''}", motion)
    if not context.quick:
        yield from over_periods(context)
        yield from orders(context)
    yield from bouncing_block(context)


def over_periods(context):
    """Energy of the bar that bounces."""
    periods = 10
    for integrator in INTEGRATORS:
        motion = run(context, Bar, integrator, 50, 0.2, periods=periods)
        free = np.abs(motion.pressure) == 0  # in contact the barrier has a share
        energy = motion.energy[free] / Bar.energy
        bar = None if integrator == "ImplicitNewmark" else 1e-3
        yield Result(f"energy above its start, {integrator}, {periods} periods", excess(float(energy.max()), 1.0), bar,
                     float(energy[-1] * Bar.energy), Bar.energy, "value: at the last time out of contact [J]")


def orders(context):
    """Of the displacement's error: in cells with dt, and in dhat."""
    sizes = [25, 50, 100, 200]
    errors = [run(context, Bar, "BDF2", cells, 0.1, periods=1).error for cells in sizes]
    order = float(fitted_order(1 / np.array(sizes), errors))
    yield Result("bar that bounces, BDF2: order of the displacement in element size and dt", excess(0.6, order), 0.0, order, 2 / 3,
                 "errors " + ", ".join(f"{e:.2e}" for e in errors) + f" with {', '.join(map(str, sizes))} cells; velocities jump")
    gaps = [8e-2, 4e-2, 2e-2]
    errors = [run(context, Bar, "BDF2", 50, 0.1, dhat=dhat, periods=1).error for dhat in gaps]
    yield Result("bar that bounces, BDF2: displacement by dhat, at the smallest", errors[-1], 0.05, None, None,
                 "errors " + ", ".join(f"{e:.2e}" for e in errors) + f" for dhat {', '.join(f'{g:g}' for g in gaps)} of the length")


def bouncing_block(context):
    """A turning block that falls on a floor and bounces, remeshed all the time: what remeshing and projection add to energy and
    momentum."""
    steps, h, g, rho, dhat = (100 if context.quick else 2000), 2e-3, 9.81, 1000.0, 1e-3
    points, cells = box_mesh([6, 6], [1.0, 1.0], jitter=0.2)
    mesh, floor = context.folder / "block.msh", context.folder / "floor.obj"
    turn = np.array([[0.8, -0.6], [0.6, 0.8]])
    points = points @ turn.T
    points[:, 1] += 0.05 - points[:, 1].min()
    write_mesh(mesh, points, cells)
    write_line(floor, (-50, 0), (50, 0))
    content = scene(mesh, {"type": "NeoHookean", "E": 1e5, "nu": 0.3, "rho": rho},
                    boundary_conditions={"rhs": [0, g]}, initial_conditions={"velocity": [{"id": 1, "value": ["1 - y", "x - 1"]}]},
                    time={"dt": h, "time_steps": steps, "integrator": "ImplicitEuler"},
                    space={"remesh": {"enabled": True, "split": {"acceptance_tolerance": 0.02}, "swap": {"enabled": True},
                                      "smooth": {"enabled": True}, "collapse": {"acceptance_tolerance": -2e-5, "rel_max_edge_length": 3}}},
                    output={"paraview": {"options": {"kinetic_energy": True, "momentum": True}}})
    content["solver"]["nonlinear"]["x_delta"] = 1e-9
    found = run_scene(context, "block", with_obstacle(content, floor, dhat, 1e5))
    energy, momentum = [], []
    for path, step in zip(sorted((found.folder / "frames").glob("*.h5")), found.steps):
        with h5py.File(path) as file:
            stored = float(file["totals/kinetic_energy"][()][0]) + step["energy"]["elastic"] + step["energy"]["contact"]
            energy.append((stored, stored + step["energy"]["body"]))
            momentum.append(file["totals/momentum"][()].ravel())
    stored, whole = np.array(energy).T
    accepted = sum(s[kind]["accepted"] for s in found.steps for kind in ("splits", "collapses", "swaps", "smooths"))
    yield Result("block that bounces, remeshed: growth of energy in a step, by what is stored",
                 float((np.diff(whole) / np.maximum.accumulate(stored)[1:]).max()), 1e-6,
                 note=f"{steps} steps, {accepted} operations accepted, {found.steps[-1]['vertices']} vertices at the end")
    first = next((k for k, s in enumerate(found.steps) if s["min_distance"] is not None), len(found.steps))
    flight = np.array(momentum[:first])
    exact = flight[0] + np.outer(np.arange(len(flight)) * h, [0, -g * rho * 1.0])
    yield Result("block in flight, remeshed: momentum", float(np.abs(flight - exact).max() / np.abs(exact).max()), 1e-10,
                 note=f"{len(flight) - 1} steps, {sum(s[k]['accepted'] for s in found.steps[:first] for k in ('splits', 'swaps', 'smooths'))} operations")
