# SPDX-License-Identifier: MIT
"""Two bars on each other, the upper one hot and pressed by a traction p: the flux of heat through both is that of their
resistances in series with 1 / h(p). Their law is written in UFL. The strain of heat bends the displacement over the height, so
ITR refines the mesh, and the flux stays."""

import logging
import sys

import numpy as np
from heat import Heat
from ufl_law import UflLaw, neo_hookean

import itr

E, NU, TRACTION = 1e6, 0.3, 2e4  # [Pa]
WIDTH, LENGTH, GAP = 0.1, (0.15, 0.2), 5e-5  # [m]
CONDUCTIVITY, COLD, HOT, EXPANSION = {0: 50.0, 1: 15.0}, 20.0, 120.0, 2e-4  # [W/m/K], [C], [1/K]


def conductance(p):
    return 1e-2 * p  # [W/m^2/K]


def bar(columns, rows, bottom, length):
    """Vertices and cells of a bar of the given width."""
    points = np.array([(WIDTH * i / columns, bottom + length * j / rows) for j in range(rows + 1) for i in range(columns + 1)])
    a = np.array([j * (columns + 1) + i for j in range(rows) for i in range(columns)])
    d = a + columns + 1
    return points, np.concatenate([np.stack([a, a + 1, d + 1], 1), np.stack([a, d + 1, d], 1)])


def make(law, remesh):
    """The simulation, and the heat in it. `law`: a UflLaw, or None for ITR's NeoHookean."""
    lower, cells = bar(5, 7, 0, LENGTH[0])
    upper, upper_cells = bar(4, 9, LENGTH[0] + GAP, LENGTH[1])
    bodies = np.repeat([0, 1], [len(cells), len(upper_cells)])
    points = np.concatenate([lower, upper])
    model = itr.Model(points, np.concatenate([cells, upper_cells + len(lower)]), bodies)
    held = {
        model.add_boundary("bottom", where=lambda X: X[1] < 1e-9): COLD,
        model.add_boundary("top", where=lambda X: X[1] > points[-1, 1] - 1e-9): HOT,
    }
    model.add_boundary("sides", where=lambda X: min(X[0], WIDTH - X[0]) < 1e-9)
    model.set_options({
        "materials": {"type": "NeoHookean", "E": E, "nu": NU, "rho": 1000},
        "time": {"dt": 1, "time_steps": 1, "quasistatic": True},
        "contact": {"enabled": True, "dhat": 1e-4},
        "space": {"remesh": {"enabled": remesh, "split": {"acceptance_tolerance": 1e-8}}},
    })
    if law:
        law.set(model, 0)
        law.set(model, 1)
    simulation = itr.Simulation(model)
    simulation.fix("bottom", [0, 0])
    simulation.fix("sides", [0, 0], mask=[True, False])
    simulation.set_traction("top", [0, -TRACTION])
    return simulation, Heat(simulation, CONDUCTIVITY, 2e6, conductance, held, COLD)


def run(law, remesh, steps=5):
    """Alternates steps and steady temperatures. Returns the simulation, the heat, the flux [W/m^2] and that of the closed form."""
    simulation, heat = make(law, remesh)
    for _ in range(steps):
        simulation.set_eigenstrain(EXPANSION * (heat.temperature - COLD))
        simulation.step()
        flux = heat.step()
    body = heat.bodies()
    lengths = [np.ptp(simulation.positions[body == i, 1]) for i in (0, 1)]
    resistance = lengths[0] / CONDUCTIVITY[0] + 1 / conductance(TRACTION) + lengths[1] / CONDUCTIVITY[1]
    return simulation, heat, max(flux.values()) / WIDTH, (HOT - COLD) / resistance


def derivative_errors(law):
    """Of stress and tangent of a law against central differences, relative to the largest entry."""
    F, h = np.array([[1.2, 0.3], [-0.1, 0.8]]), 1e-6
    (_, P, H), differences = law.evaluate(F), np.zeros((2, 2, 2, 2))
    stress = np.zeros((2, 2))
    for i, j in np.ndindex(2, 2):
        step = np.zeros((2, 2))
        step[i, j] = h
        ahead, behind = law.evaluate(F + step), law.evaluate(F - step)
        stress[i, j], differences[..., i, j] = (ahead[0] - behind[0]) / (2 * h), (ahead[1] - behind[1]) / (2 * h)
    return np.abs(P - stress).max() / np.abs(P).max(), np.abs(H - differences).max() / np.abs(H).max()


def main():
    logging.disable(logging.INFO)  # the form compiler tells of every file that it compiles
    law = UflLaw(neo_hookean(E, NU))
    errors = derivative_errors(law)
    print(f"law in UFL: off central differences by {errors[0]:.1e} (stress) and {errors[1]:.1e} (tangent)")
    built_in, *_ = run(None, False)
    fixed, _, flux, expected = run(law, False)
    scale = np.abs(built_in.forces("reaction")).max()
    apart = max(np.abs(fixed.forces(kind) - built_in.forces(kind)).max() for kind in ("contact", "reaction")) / scale
    print(f"law in UFL: forces apart from those of the built-in law by {apart:.1e} of the largest")
    remeshed, heat, refined_flux, refined_expected = run(law, True)
    for before, after in heat.transfers:
        print(f"heat content {before:.9e} J/m before the transfer, {after:.9e} after")
    print(f"{len(fixed.positions)} vertices: flux {flux:.3f} W/m^2, closed form {expected:.3f}")
    print(f"{len(remeshed.positions)} vertices: flux {refined_flux:.3f} W/m^2, closed form {refined_expected:.3f}")
    lost = max(abs(after / before - 1) for before, after in heat.transfers)
    ok = max(errors) < 1e-8 and apart < 1e-9 and lost < 1e-12 and len(remeshed.positions) > 2 * len(fixed.positions)
    ok = ok and abs(flux / expected - 1) < 1e-4 and abs(refined_flux / refined_expected - 1) < 1e-4
    return 0 if ok else 1


if __name__ == "__main__":
    sys.exit(main())
