# SPDX-License-Identifier: MIT
"""Contact and friction in 3D: two blocks under pressure, whose meshes match or do not, and a block on a slope."""
import numpy as np
from harness.contact import gap_of_pressure, with_contact, with_obstacle, write_plane
from harness.fields import consistent_mass_product, fitted_order, gradients, volumes
from harness.scenes import box_mesh, run_scene, scene, write_mesh
from harness.suite import Result, compare, excess

TITLE = "Contact in 3D: patch test, slope"
QUANTITY = ("stress of two blocks under pressure against the uniform one, L2, and its order in dhat; creep and acceleration of a block "
            "on a slope")
REFERENCE = "the uniform stress; Coulomb's law"
TOLERANCE = "stress 1e-3 at the smallest dhat, first order in dhat where meshes match; creep and acceleration 1e-4"
NEEDS = ("meshio", "h5py")

PRESSURE, YOUNG = 1e3, 1e6


def patch(context, below, above, dhat):
    """L2 norm of the stress's difference to the uniform one, relative, in two blocks of so many cells along the contact."""
    geometry = []
    for k, (cells_along, bottom) in enumerate(((below, 0), (above, 0.5 + gap_of_pressure(PRESSURE / 2, dhat, YOUNG)))):
        # Moved interior vertices: no mesh line of one block lies over one of the other but at the sides.
        points, cells = box_mesh([cells_along, cells_along, max(1, cells_along // 2)], [1.0, 1.0, 0.5], jitter=0.2, seed=k)
        mesh = context.folder / f"block-{below}-{above}-{dhat:g}-{k}.msh"
        write_mesh(mesh, points + [0, 0, bottom], cells)
        geometry.append({"mesh": str(mesh), "surface_selection": {"threshold": 1e-6, "id_offset": 10 * k}})
    held = lambda tag, axis: {"id": tag, "value": [0, 0, 0], "dimension": [k == axis for k in range(3)]}
    content = scene("", {"type": "LinearElasticity", "E": YOUNG, "nu": 0, "rho": 1.0},
                    boundary_conditions={"dirichlet_boundary": [{"id": 5, "value": [0, 0, 0]}, *(held(tag, 0) for tag in (1, 11, 3, 13)),
                                                                *(held(tag, 1) for tag in (2, 12, 4, 14))],
                                         "neumann_boundary": [{"id": 16, "value": [0, 0, -PRESSURE]}]})
    content["geometry"] = geometry
    frame = run_scene(context, f"patch-{below}-{above}-{dhat:g}", with_contact(content, dhat, YOUNG)).last()
    slopes = gradients(frame.rest, frame.cells, frame.u)
    stress = YOUNG * (slopes + slopes.transpose(0, 2, 1)) / 2
    stress[:, 2, 2] += PRESSURE
    return float(np.sqrt(volumes(frame.rest, frame.cells) @ (stress**2).sum(axis=(1, 2))) / PRESSURE)


def patches(context):
    gaps = [1e-5, 1e-6, 1e-7, 1e-8]
    for below, above in [(3, 3), (3, 4)] if context.quick else [(3, 3), (3, 4), (4, 6), (6, 9)]:
        errors = [patch(context, below, above, dhat) for dhat in gaps]
        note = "errors " + ", ".join(f"{e:.2e}" for e in errors) + " for dhat of 1e-5 to 1e-8"
        yield Result(f"patch test, {below} cells on {above}: stress at the smallest dhat, L2", errors[-1], 1e-3, note=note)
        # Where vertices lie over faces it is reached later, the finer the later; elsewhere it is there at once, and at 1e-8 the
        # error is that of steps that are ended at 1e-11 m.
        fitted = slice(0, 3) if below == above else slice(1, 4)
        order = float(fitted_order(gaps[fitted], errors[fitted]))
        yield Result(f"patch test, {below} cells on {above}: order of the stress's error in dhat", excess(1, order),
                     0.1 if below == above else None, order, 1)


def slope(context):
    mu, rho, epsv, size, g = 0.5, 1000.0, 1e-3, [0.2, 0.1, 0.1], 9.81
    h, end, dhat, kappa = 0.005, 0.5, 1e-3, 1e6
    points, cells = box_mesh([3, 2, 2], size)
    mass = rho * np.prod(size)
    ground = context.folder / "slope.obj"
    write_plane(ground, 0)
    for share in (0.9, 1.1) if context.quick else (0.5, 0.9, 0.99, 1.01, 1.1, 2.0):
        angle = np.arctan(share * mu)
        # The slope is level and gravity leans, in a direction of no mesh line; vertices have a quarter of the barrier's weight here.
        lean = np.array([np.cos(0.3), np.sin(0.3), 0])
        gravity = g * (np.sin(angle) * lean - np.cos(angle) * np.array([0, 0, 1]))
        gap = gap_of_pressure(rho * g * np.cos(angle) * size[2], dhat, kappa / 2)
        mesh = context.folder / f"block-{share}.msh"
        write_mesh(mesh, points + [0, 0, gap], cells)
        content = scene(mesh, {"type": "NeoHookean", "E": 1e7, "nu": 0.3, "rho": rho},
                        boundary_conditions={"rhs": list(-gravity)},
                        time={"dt": h, "tend": end, "integrator": "ImplicitEuler"})
        content["solver"]["nonlinear"]["x_delta"] = 1e-8
        run = run_scene(context, f"slope-{share}", with_obstacle(content, ground, dhat, kappa, epsv=epsv, friction_coefficient=mu))
        t, speed, aside = np.array([(f.t, velocity @ lean, abs(np.cross(lean, velocity)[2])) for f in run.frames()
                                    for velocity in [consistent_mass_product(f.rest, f.cells, rho, f.v).sum(axis=0) / mass]]).T
        if share < 1:
            # Smoothed friction (1 - (1 - v / eps_v)^2 of Coulomb's) holds the block's weight at this speed.
            yield compare(f"slope, tan = {share} mu: speed of creep over eps_v", float(speed[-1] / epsv),
                          float(1 - np.sqrt(1 - share)), 1e-4)
        else:
            later = t > end / 2
            found = float(np.polyfit(t[later], speed[later], 1)[0])
            yield compare(f"slope, tan = {share} mu: acceleration [m/s^2]", found, float(g * (np.sin(angle) - mu * np.cos(angle))), 1e-4)
        yield Result(f"slope, tan = {share} mu: speed across by that along", float(aside[-1] / speed[-1]), 1e-3)


def results(context):
    yield from patches(context)
    yield from slope(context)
