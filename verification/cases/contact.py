# SPDX-License-Identifier: MIT
"""Contact and friction in 2D: a block's weight, a block on a slope, two blocks under pressure."""
import numpy as np
from harness.contact import (barrier_pressure, gap_of_pressure, vertex_lengths, with_contact, with_obstacle,
                             write_line)
from harness.fields import consistent_mass_product, fitted_order, gradients, volumes
from harness.scenes import box_mesh, run_scene, scene, write_mesh
from harness.suite import Result, compare, excess

TITLE = "Contact: weight, slope, patch test"
QUANTITY = ("sum of contact forces against the weight; threshold and acceleration of a block on a slope; stress of two blocks "
            "under pressure against the uniform one, L2")
REFERENCE = "statics; Coulomb's law; the uniform stress"
TOLERANCE = "weight 1e-8; creep and acceleration 1e-4; uniform stress as dhat vanishes, at first order"
NEEDS = ("meshio", "h5py")

G = 9.81
DHAT, KAPPA = 1e-3, 1e6


def weight(context):
    rho, size, n = 1000.0, [1.0, 0.5], [8, 4]
    points, cells = box_mesh(n, size, jitter=0.2)
    mesh, ground = context.folder / "block.msh", context.folder / "ground.obj"
    write_mesh(mesh, points + [0, 0.5 * DHAT], cells)
    write_line(ground, (-9, 0), (10, 0))
    for name, law in (("neo-Hookean", "NeoHookean"), ("linear", "LinearElasticity")):
        content = scene(mesh, {"type": law, "E": 2e5, "nu": 0.3, "rho": rho},
                        boundary_conditions={"rhs": [0, G],
                                             "dirichlet_boundary": [{"id": 1, "value": [0, 0], "dimension": [True, False]}]})
        run = run_scene(context, f"weight-{law}", with_obstacle(content, ground, DHAT, KAPPA))
        frame = run.last()
        bottom = np.isclose(points[:, 1], 0)
        forces = vertex_lengths(frame.rest, frame.cells) * barrier_pressure(np.maximum(frame.x[:, 1], 1e-300), DHAT, KAPPA)
        total = rho * G * size[0] * size[1]
        yield Result(f"weight, {name} [N]", abs(forces[bottom].sum() / total - 1), 1e-8, float(forces[bottom].sum()), total,
                     f"gaps {frame.x[bottom, 1].min() / DHAT:.2f} to {frame.x[bottom, 1].max() / DHAT:.2f} dhat")


def slope(context):
    mu, rho, epsv, size = 0.5, 1000.0, 1e-3, [0.2, 0.1]
    h, end = 0.005, 0.5
    points, cells = box_mesh([4, 2], size)
    ground = context.folder / "slope.obj"
    write_line(ground, (-90, 0), (90, 0))
    for share in (0.9, 0.99, 1.01, 1.1) if context.quick else (0.5, 0.9, 0.99, 1.01, 1.1, 2.0):
        angle = np.arctan(share * mu)
        # The slope is level and gravity leans; the block starts where its weight holds it.
        gap = gap_of_pressure(rho * G * np.cos(angle) * size[1], DHAT, KAPPA)
        mesh = context.folder / f"block-{share}.msh"
        write_mesh(mesh, points + [0, gap], cells)
        content = scene(mesh, {"type": "NeoHookean", "E": 1e7, "nu": 0.3, "rho": rho},
                        boundary_conditions={"rhs": [-G * np.sin(angle), G * np.cos(angle)]},
                        time={"dt": h, "tend": end, "integrator": "ImplicitEuler"})
        content["solver"]["nonlinear"]["x_delta"] = 1e-8
        run = run_scene(context, f"slope-{share}", with_obstacle(content, ground, DHAT, KAPPA, epsv=epsv,
                                                                 friction_coefficient=mu))
        t, speed = np.array([(f.t, consistent_mass_product(f.rest, f.cells, rho, f.v).sum(axis=0)[0] / (rho * size[0] * size[1]))
                             for f in run.frames()]).T
        if share < 1:
            # Smoothed friction (1 - (1 - v / eps_v)^2 of Coulomb's) holds the block's weight at this speed.
            creep = 1 - np.sqrt(1 - share)
            yield compare(f"slope, tan = {share} mu: speed of creep over eps_v", float(speed[-1] / epsv), float(creep), 1e-4)
        else:
            later = t > end / 2
            found = float(np.polyfit(t[later], speed[later], 1)[0])
            exact = G * (np.sin(angle) - mu * np.cos(angle))
            yield compare(f"slope, tan = {share} mu: acceleration [m/s^2]", found, float(exact), 1e-4)


PRESSURE, YOUNG = 1e3, 1e6


def patch(context, below, above, dhat):
    """L2 norm of the stress's difference to the uniform one, relative, in two blocks of so many cells along the contact."""
    lower, lower_cells = box_mesh([below, max(1, below // 2)], [1.0, 0.5])
    upper, upper_cells = box_mesh([above, max(1, above // 2)], [1.0, 0.5])
    kappa = YOUNG
    # Both sides' pairs carry half of the pressure each: together what barrier_pressure has twice.
    upper = upper + [0, 0.5 + gap_of_pressure(PRESSURE / 2, dhat, kappa)]
    geometry = []
    for name, points, cells in (("lower", lower, lower_cells), ("upper", upper, upper_cells)):
        mesh = context.folder / f"{name}-{len(points)}-{dhat:g}.msh"
        write_mesh(mesh, points, cells)
        offset = {"lower": 0, "upper": 10}[name]
        geometry.append({"mesh": str(mesh), "surface_selection": {"threshold": 1e-6, "id_offset": offset}})
    sideways = [{"id": tag, "value": [0, 0], "dimension": [True, False]} for tag in (1, 11)]
    content = scene("", {"type": "LinearElasticity", "E": YOUNG, "nu": 0, "rho": 1.0},
                    boundary_conditions={"dirichlet_boundary": [{"id": 2, "value": [0, 0]}, *sideways],
                                         "neumann_boundary": [{"id": 14, "value": [0, -PRESSURE]}]})
    content["geometry"] = geometry
    frame = run_scene(context, f"patch-{below}-{above}-{dhat:g}", with_contact(content, dhat, kappa)).last()
    slopes = gradients(frame.rest, frame.cells, frame.u)
    stress = YOUNG * (slopes + slopes.transpose(0, 2, 1)) / 2
    stress[:, 1, 1] += PRESSURE
    return float(np.sqrt(volumes(frame.rest, frame.cells) @ (stress**2).sum(axis=(1, 2))) / PRESSURE)


def results(context):
    yield from weight(context)
    yield from slope(context)
    gaps = [1e-5, 1e-6, 1e-7, 1e-8]
    meshes = [(8, 8), (8, 12), (8, 11)] if context.quick else [(8, 8), (8, 12), (8, 11), (16, 24), (32, 48)]
    for below, above in meshes:
        found = [patch(context, below, above, dhat) for dhat in gaps]
        order = float(fitted_order(gaps[1:], found[1:]))  # at 1e-5 the gap is no small part of a cell
        yield Result(f"patch test, {below} cells on {above}, order of the stress's error in dhat", excess(1, order), 0.1, order,
                     1, "errors " + ", ".join(f"{e:.2e}" for e in found) + " for dhat of 1e-5 to 1e-8")
