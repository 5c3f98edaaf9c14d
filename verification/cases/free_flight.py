# SPDX-License-Identifier: MIT
"""A soft body that flies, spins and vibrates without load."""
import numpy as np
from harness.fields import consistent_mass_product, fitted_order, gradients, volumes
from harness.materials import lame
from harness.scenes import box_mesh, run_scene, scene, write_mesh
from harness.suite import Result, excess

TITLE = "Free flight: momentum and energy"
QUANTITY = ("linear momentum, the centre of mass's path and energy over the whole run; order in the time step of the drift of "
            "angular momentum and energy")
REFERENCE = "conservation laws; orders of the integrators (Hairer, Lubich & Wanner 2006)"
TOLERANCE = "1e-10 of momentum; orders 0.15"
NEEDS = ("meshio", "h5py")

E, NU, RHO = 1e5, 0.3, 1000.0
H = 2e-3
VELOCITY = {2: [0.7, 0.4], 3: [0.7, 0.4, -0.2]}
ORDERS = {"ImplicitEuler": 1, "ImplicitNewmark": 2, "BDF2": 2}
MESHES = {2: ([6, 3], [1.0, 0.5]), 3: ([3, 2, 2], [1.0, 0.6, 0.5])}


def invariants(frame):
    """Linear momentum, angular momentum about the origin, total energy."""
    momentum = consistent_mass_product(frame.rest, frame.cells, RHO, frame.v)
    angular = np.cross(frame.x, momentum).sum(axis=0)
    F = np.eye(frame.x.shape[1]) + gradients(frame.rest, frame.cells, frame.u)
    mu, lmbda = lame(E, NU, F.shape[1])
    log_J = np.log(np.linalg.det(F))
    density = mu / 2 * ((F**2).sum(axis=(1, 2)) - F.shape[1] - 2 * log_J) + lmbda / 2 * log_J**2
    return momentum.sum(axis=0), angular, (frame.v * momentum).sum() / 2 + volumes(frame.rest, frame.cells) @ density


def fly(context, name, dim, rule, h, steps, kept):
    points, cells = box_mesh(*MESHES[dim], jitter=0.2)
    points = points - points.mean(axis=0)
    mesh = context.folder / f"body{dim}.msh"
    write_mesh(mesh, points, cells)
    velocity = [f"{v} + {3 if k == 1 else -3} * {'xyz'[1 - k]}" if k < 2 else v for k, v in enumerate(VELOCITY[dim])]
    content = scene(mesh, {"type": "NeoHookean", "E": E, "nu": NU, "rho": RHO},
                    initial_conditions={"velocity": [{"id": 1, "value": velocity}], "acceleration": "consistent"},
                    time={"dt": h, "time_steps": steps, "integrator": rule},
                    output={"paraview": {"skip_frame": steps // kept}})
    run = run_scene(context, name, content)
    frames = list(run.frames())
    return frames, [invariants(frame) for frame in frames]


def results(context):
    steps = 1000 if context.quick else 10000
    histories = {}
    for dim in (2, 3):
        for rule, order in ORDERS.items():
            if context.quick and dim == 3 and rule != "BDF2":
                continue
            frames, found = fly(context, f"{dim}d-{rule}", dim, rule, H, steps, 100)
            momentum, angular, energy = (np.array(column) for column in zip(*found))
            scale = np.linalg.norm(momentum[0])
            yield Result(f"{dim}D, {rule}, linear momentum", float(np.abs(momentum - momentum[0]).max() / scale), 1e-10,
                         note=f"{frames[-1].step} steps")
            mass = RHO * volumes(frames[0].rest, frames[0].cells).sum()
            centre = lambda f: consistent_mass_product(f.rest, f.cells, RHO, f.x).sum(axis=0) / mass
            off = np.max([np.linalg.norm(centre(f) - centre(frames[0]) - f.t * momentum[0] / mass) for f in frames])
            yield Result(f"{dim}D, {rule}, path of the centre of mass", float(off / (frames[-1].t * scale / mass)), 1e-10)
            kinetic_of_flight = scale**2 / (2 * mass)
            internal = (energy - kinetic_of_flight) / (energy[0] - kinetic_of_flight)  # spin and vibration
            histories[f"{dim}D, {rule}"] = np.array([f.t for f in frames]), internal
            yield Result(f"{dim}D, {rule}, energy of spin and vibration at the end is at most the initial",
                         excess(float(internal[-1]), 1), 1e-4, float(internal[-1]), 1)
            if rule == "ImplicitEuler":  # dissipates in every step, where the others may oscillate
                yield Result(f"{dim}D, {rule}, growth of energy from one look to the next",
                             excess(float(np.diff(internal).max()), 0), 1e-9)
    context.figure("energy", lambda axes: draw(axes, histories))
    for rule, order in ORDERS.items():
        sizes = np.array([4e-3, 2e-3, 1e-3, 5e-4])
        drifts = []
        for h in sizes:
            _, found = fly(context, f"order-{rule}-{h}", 2, rule, h, round(0.4 / h), 20)
            angular, energy = (np.array(column) for column in list(zip(*found))[1:])
            drifts.append([np.abs(angular - angular[0]).max(), np.abs(energy - energy[0]).max()])
        for name, drift in zip(("angular momentum", "energy"), np.array(drifts).T):
            p = float(fitted_order(sizes, drift))
            yield Result(f"2D, {rule}, order of the drift of {name}", excess(order, p), 0.15, p, order, "at least")


def draw(axes, histories):
    for name, (t, energy) in histories.items():
        axes.plot(t, energy, label=name)
    axes.set(xlabel="t [s]", ylabel="energy of spin and vibration / initial", ylim=(0, 1.2))
    axes.legend()
