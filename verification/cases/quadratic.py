# SPDX-License-Identifier: MIT
"""What P1 is held against elsewhere, by quadratic elements: Cook's membrane, bending, nearly incompressible bodies, contact, a wave,
free flight."""
import h5py
import numpy as np
from harness.contact import barrier_pressure, gap_of_pressure, with_contact, with_obstacle, write_line
from harness.fields import errors, fitted_order
from harness.scenes import box_mesh, run_scene, scene, with_edge_nodes, write_mesh
from harness.suite import Result, compare, excess

TITLE = "Quadratic elements"
QUANTITY = ("error of Cook's energy; tip of a cantilever and of a nearly incompressible one; stress of two blocks under pressure; "
            "weight on an obstacle; wave speed; momentum")
REFERENCE = "FEniCSx P3 on a graded mesh; beam theory; finest P2; the uniform stress; statics; d'Alembert; conservation"
TOLERANCE = "each result's own"
NEEDS = ("meshio", "h5py")

COOK_ENERGY = -8568553.102950882  # cases/cook.py, STORED_ENERGY
ORDERS = (1, 2)


def unknowns(run):
    return run.steps[-1]["unknowns"]


def cook(context):
    """Errors at the same number of unknowns: P1 on a mesh once finer than P2's."""
    path = context.data("paper-scenes/scripts/cantilever/cantilever.json")
    rows = []
    for order, levels in ((1, range(2, 7)), (2, range(1, 6))):
        for level in levels:
            run = run_scene(context, f"cook-p{order}-{level}", path, "/space/remesh/enabled=false", f"/geometry/0/n_refs={level}",
                            f"/space/discr_order={order}")
            rows.append((order, level, unknowns(run), run.steps[-1]["energy"]["total"] - COOK_ENERGY))
    context.table("cook", ["order", "n_refs", "unknowns", "error of the energy [J]"], rows)
    error = {(order, level): value for order, level, _, value in rows}
    for level in range(1, 6):
        ratio = error[2, level] / error[1, level + 1]
        yield Result(f"Cook, error of P2 on n_refs {level} over P1's on n_refs {level + 1}", ratio, 0.2, error[2, level],
                     error[1, level + 1], "as many unknowns [J]")


def cantilever(context):
    """A beam of length 10 and height 1 in plane stress that a shear force bends; small displacements."""
    E, length, force = 1e6, 10.0, 1e-3
    exact = force * length**3 / (3 * E / 12) + 1.2 * force * length / (E / 2)  # Timoshenko, nu = 0
    for order in ORDERS:
        found = []
        for n in (1, 2, 4):
            points, cells = box_mesh([10 * n, n], [length, 1.0])
            mesh = context.folder / f"cantilever-{n}.msh"
            write_mesh(mesh, points, cells)
            content = scene(mesh, {"type": "LinearElasticity", "E": E, "nu": 0, "rho": 1.0}, order,
                            boundary_conditions={"dirichlet_boundary": [{"id": 1, "value": [0, 0]}],
                                                 "neumann_boundary": [{"id": 3, "value": [0, f"{6 * force} * y * (1 - y)"]}]})
            frame = run_scene(context, f"cantilever-p{order}-{n}", content).last()
            found.append(float(frame.u[np.isclose(frame.rest[:, 0], length), 1].mean() / exact))
        note = "share of the deflection with 1, 2, 4 cells across: " + ", ".join(f"{share:.4f}" for share in found)
        yield Result(f"cantilever, P{order}, deflection by 4 cells across", abs(found[-1] - 1), 5e-3 if order == 2 else None,
                     found[-1], 1, note)


def locking(context):
    """A block of plane strain, clamped at one side, that a traction shears: its tip against the finest P2's."""
    E, size = 1e6, [2.0, 1.0]
    for nu in (0.3, 0.49, 0.499):
        tips = {}
        for order, counts in ((1, (4, 8, 16, 32)), (2, (2, 4, 8, 16, 48))):
            for n in counts:
                points, cells = box_mesh([2 * n, n], size)
                mesh = context.folder / f"locking-{n}.msh"
                write_mesh(mesh, points, cells)
                content = scene(mesh, {"type": "NeoHookean", "E": E, "nu": nu, "rho": 1.0, "plane_strain": True}, order,
                                boundary_conditions={"dirichlet_boundary": [{"id": 1, "value": [0, 0]}],
                                                     "neumann_boundary": [{"id": 3, "value": [0, 1e4]}]})
                frame = run_scene(context, f"locking-{nu}-p{order}-{n}", content).last()
                tips[order, n] = float(frame.u[np.isclose(frame.rest[:, 0], size[0]), 1].mean())
        exact = tips[2, 48]
        for order, counts in ((1, (4, 8, 16, 32)), (2, (2, 4, 8, 16))):
            off = [abs(tips[order, n] / exact - 1) for n in counts]
            note = f"{', '.join(map(str, counts))} cells across: " + ", ".join(f"{100 * e:.2g} %" for e in off)
            yield Result(f"nu = {nu}, P{order}, deflection", off[-1], 1e-2 if order == 2 else None, tips[order, counts[-1]],
                         exact, note)


PRESSURE, YOUNG = 1e3, 1e6


def patch(context, below, above, dhat):
    """L2 norm of the strain's difference to the uniform one, relative, as in cases/contact.py."""
    geometry = []
    gap = gap_of_pressure(PRESSURE / 2, dhat, YOUNG)
    for name, n, up, offset in (("lower", below, 0, 0), ("upper", above, 0.5 + gap, 10)):
        points, cells = box_mesh([n, max(1, n // 2)], [1.0, 0.5])
        mesh = context.folder / f"{name}-{n}-{dhat:g}.msh"
        write_mesh(mesh, points + [0, up], cells)
        geometry.append({"mesh": str(mesh), "surface_selection": {"threshold": 1e-6, "id_offset": offset}})
    sideways = [{"id": tag, "value": [0, 0], "dimension": [True, False]} for tag in (1, 11)]
    content = scene("", {"type": "LinearElasticity", "E": YOUNG, "nu": 0, "rho": 1.0}, 2,
                    boundary_conditions={"dirichlet_boundary": [{"id": 2, "value": [0, 0]}, *sideways],
                                         "neumann_boundary": [{"id": 14, "value": [0, -PRESSURE]}]})
    content["geometry"] = geometry
    frame = run_scene(context, f"patch-{below}-{above}-{dhat:g}", with_contact(content, dhat, YOUNG)).last()
    points = frame.rest[:frame.cells.max() + 1]
    nodes, cells, _ = with_edge_nodes(points, frame.cells)
    assert np.allclose(nodes, frame.rest, atol=1e-12)
    uniform = np.diag([0, -PRESSURE / YOUNG])
    slope = errors(points, cells, frame.u, np.zeros_like, lambda X: np.broadcast_to(uniform, (len(X), 2, 2)), 2)[1]
    return float(slope * YOUNG / PRESSURE)


def patch_test(context):
    gaps = [1e-5, 1e-6, 1e-7]
    for n in (4,) if context.quick else (4, 8, 16):
        found = [patch(context, n, n, dhat) for dhat in gaps]
        order = float(fitted_order(gaps[1:], found[1:]))
        yield Result(f"patch test, {n} cells on {n}, order of the stress's error in dhat", excess(1, order), 0.1, order,
                     1, "errors " + ", ".join(f"{e:.2e}" for e in found) + " for dhat of 1e-5 to 1e-7")
    # Chords' weights (1, 2, 1) are not those of quadratic functions (1, 4, 1), which gaps make up for where nodes match. Where
    # they do not, curves leave their chords by more than the gap, and chords are refined until they do not.
    counts = (4, 8, 16) if context.quick else (4, 8, 16, 32, 64)
    found = [patch(context, n, 3 * n // 2, 1e-7) for n in counts]
    yield Result("patch test, 2 cells on 3, the stress's error", max(found), 1e-3,
                 note=f"errors {', '.join(f'{e:.2e}' for e in found)} for {', '.join(map(str, counts))} cells")


def weight(context):
    rho, size, dhat, kappa = 1000.0, [1.0, 0.5], 1e-3, 1e6
    points, cells = box_mesh([8, 4], size, jitter=0.2)
    mesh, ground = context.folder / "block.msh", context.folder / "ground.obj"
    write_mesh(mesh, points + [0, 0.5 * dhat], cells)
    write_line(ground, (-9, 0), (10, 0))
    content = scene(mesh, {"type": "NeoHookean", "E": 2e5, "nu": 0.3, "rho": rho}, 2,
                    boundary_conditions={"rhs": [0, 9.81],
                                         "dirichlet_boundary": [{"id": 1, "value": [0, 0], "dimension": [True, False]}]})
    frame = run_scene(context, "weight", with_obstacle(content, ground, dhat, kappa)).last()
    bottom = np.flatnonzero(np.isclose(frame.rest[:, 1], 0.5 * dhat))
    along = bottom[np.argsort(frame.rest[bottom, 0])]
    lengths = np.zeros(len(along))
    chords = np.diff(frame.rest[along, 0])
    lengths[:-1] += chords / 2
    lengths[1:] += chords / 2
    # The corners have the chords of the sides too.
    sides = [np.sort(frame.rest[np.isclose(frame.rest[:, 0], x), 1])[:2] for x in (0, size[0])]
    lengths[[0, -1]] += [np.diff(side)[0] / 2 for side in sides]
    total = rho * 9.81 * size[0] * size[1]
    yield compare("weight by areas of the chord surface [N]",
                  float((lengths * barrier_pressure(frame.x[along, 1], dhat, kappa)).sum()), total, 1e-8)


def bar_wave(context):
    """As in cases/bar_wave.py, on as many cells."""
    E, rho, length, stress, n = 1e6, 100.0, 1.0, 10.0, 100 if context.quick else 400
    speed = np.sqrt(E / rho)
    h = length / speed / n / 4
    points, cells = box_mesh([n, 1], [length, length / n])
    mesh = context.folder / "bar.msh"
    write_mesh(mesh, points, cells)
    content = scene(mesh, {"type": "NeoHookean", "E": E, "nu": 0, "rho": rho}, 2,
                    boundary_conditions={"dirichlet_boundary": [{"id": 1, "value": [0, 0]}],
                                         "neumann_boundary": [{"id": 3, "value": [stress, 0]}]},
                    initial_conditions={"acceleration": "consistent"},
                    time={"dt": h, "time_steps": round(1.3 * length / speed / h), "integrator": "ImplicitNewmark"})
    content["solver"]["nonlinear"]["x_delta"] = 1e-8
    run = run_scene(context, "bar", content)
    t, at_middle = np.array([(f.t, f.u[np.isclose(f.rest[:, 0], length / 2), 0].mean()) for f in run.frames()]).T
    between = (t > 0.75 * length / speed) & (t < 1.25 * length / speed)
    particle_speed, offset = np.polyfit(t[between], at_middle[between], 1)
    coarser = 400 / n
    yield compare("wave speed [m/s]", float(-length / 2 * particle_speed / offset), float(speed), 3e-6 * coarser**2,
                  f"{n} cells along the bar")
    yield compare("particle speed behind the front [m/s]", float(particle_speed), stress / (rho * speed), 4e-6 * coarser**1.5)


def free_flight(context):
    for dim, counts, size in ((2, [4, 2], [1.0, 0.5]), (3, [2, 1, 1], [1.0, 0.6, 0.5])):
        points, cells = box_mesh(counts, size, jitter=0.2)
        mesh = context.folder / f"body{dim}.msh"
        write_mesh(mesh, points - points.mean(axis=0), cells)
        velocity = ["0.7 - 3 * y", "0.4 + 3 * x * x", "-0.2"][:dim]
        for rule in ("ImplicitEuler", "ImplicitNewmark", "BDF2"):
            steps = 300 if context.quick else 3000
            content = scene(mesh, {"type": "NeoHookean", "E": 1e5, "nu": 0.3, "rho": 1000.0}, 2,
                            initial_conditions={"velocity": [{"id": 1, "value": velocity}], "acceleration": "consistent"},
                            time={"dt": 2e-3, "time_steps": steps, "integrator": rule},
                            output={"paraview": {"skip_frame": steps // 30, "options": {"momentum": True}}})
            run = run_scene(context, f"flight-{dim}d-{rule}", content)
            momenta = []
            for path in sorted((run.folder / "frames").glob("*.h5")):
                with h5py.File(path) as file:
                    momenta.append(file["totals/momentum"][()].ravel()[:dim])
            momenta = np.array(momenta)
            yield Result(f"{dim}D, {rule}, linear momentum", float(np.abs(momenta - momenta[0]).max()
                                                                   / np.linalg.norm(momenta[0])), 1e-10, note=f"{steps} steps")


def results(context):
    for part in (cook, cantilever, locking, patch_test, weight, bar_wave, free_flight):
        yield from part(context)
