# SPDX-License-Identifier: MIT
"""Cook's membrane and a bar in 3D, both with singular corners or edges: remeshed to ever smaller tolerances from one, two and three
uniform refinements, against uniform refinement of graded meshes."""
import numpy as np
from harness.fields import fitted_order
from harness.materials import linear, neo_hookean
from harness.scenes import box_mesh, run_scene, scene, write_mesh
from harness.suite import Result

TITLE = "Convergence of remeshing"
QUANTITY = "error of the potential energy against unknowns: its slope, and what it depends on the initial mesh; default options"
REFERENCE = "FEniCSx: P3 in 2D, P2 in 3D, on graded meshes; the slope of P1 on graded meshes that are refined uniformly"
TOLERANCE = "slope at least the graded meshes' less 0.1; errors from different initial meshes at one size within 25 %"
NEEDS = ("dolfinx", "meshio", "h5py", "scipy")
QUICK = False


GRADING = 1.3  # of exponents from 1 to 2 the one with the smallest errors at these sizes


class Membrane:
    name, dim, law, density, E, nu = "Cook's membrane", 2, "NeoHookean", staticmethod(neo_hookean), 1098500.0, 0.3
    traction, steps, tags = [0.0, 62500.0], 10, (1, 3)
    tolerances = [1e4, 1e3, 1e2, 10**1.5, 10]
    graded = (8, 16, 32, 64)

    @staticmethod
    def mesh(n, grading):
        from harness.graded import mapped_mesh
        return mapped_mesh(n, grading)

    reference = (16, 2, 3)  # cells along, grading, degree
    base, reference_steps = 2, 5


class Bar(Membrane):
    name, dim, law, density, E, nu = "bar in 3D", 3, "LinearElasticity", staticmethod(linear), 1e4, 0.3
    traction, steps = [0.0, 0.0, -10.0], 4
    tolerances = [1e-4, 3e-5, 1e-5, 3e-6, 1e-6]
    graded = (4, 6, 8, 12)
    reference, base, reference_steps = (7, 2.5, 2), 1, 1

    @staticmethod
    def mesh(n, grading):
        from harness.graded import graded_bar
        return graded_bar([2 * n, n, n], [2.0, 1.0, 1.0], grading)


def solve(context, body, name, points, cells, refinements=0, tolerance=None):
    """Unknowns, energy [J] and processor seconds at the end of the load."""
    mesh = context.folder / f"{name}.msh"
    write_mesh(mesh, points, cells)
    content = scene(mesh, {"type": body.law, "E": body.E, "nu": body.nu, "rho": 1.0},
                    boundary_conditions={"dirichlet_boundary": [{"id": 1, "value": [0] * body.dim}],
                                         "neumann_boundary": [{"id": 3, "value": [f"{pull} * t" for pull in body.traction]}]},
                    time={"dt": 1 / body.steps, "tend": 1, "quasistatic": True}, output={"paraview": {"skip_frame": body.steps}})
    content["geometry"][0]["n_refs"] = refinements
    content["solver"]["nonlinear"]["x_delta"] = 1e-8
    content["solver"]["linear"] = {"solver": ["cholmod", "eigen"]}
    if tolerance:
        content["space"] = {"remesh": {"enabled": True, "split": {"acceptance_tolerance": tolerance},
                                       "collapse": {"acceptance_tolerance": -0.01 * tolerance}}}
    run = run_scene(context, name, content)
    return run.steps[-1]["unknowns"], run.steps[-1]["energy"]["total"], sum(step["processor_seconds"] for step in run.steps)


def at(n, curve):
    size, error = np.array(sorted(curve)).T
    return float(np.exp(np.interp(np.log(n), np.log(size), np.log(error))))


def by_n_refs(context, body, exact):
    """What a scene's own n_refs make of the coarsest mesh, beside the same numbers of cells in rows."""
    ours = [solve(context, body, f"{body.dim}d-n_refs-{start}", *body.mesh(body.base, 1), start)[1] - exact for start in (1, 2, 3)]
    rows = [solve(context, body, f"{body.dim}d-rows-{start}", *body.mesh(body.base * 2**start, 1))[1] - exact for start in (1, 2, 3)]
    yield Result(f"{body.name}: error of n_refs 3 over that of cells in rows", ours[-1] / rows[-1], None, None, None,
                 ", ".join(f"{error:.3g} J" for error in ours) + " by 1, 2, 3; in rows " + ", ".join(f"{error:.3g} J" for error in rows))


def study(context, body):
    from harness.graded import Clamped
    n, grading, degree = body.reference
    finest, coarser = (Clamped(*body.mesh(k, grading), degree, body.E, body.nu, body.traction, body.density,
                                body.reference_steps) for k in (n, n * 3 // 4))
    curves = {"graded meshes": [solve(context, body, f"{body.dim}d-graded-{k}", *body.mesh(k, GRADING)) for k in body.graded],
              "uniform meshes": [solve(context, body, f"{body.dim}d-uniform-{k}", *body.mesh(k, 1)) for k in body.graded]}
    for start in (1, 2, 3):
        curves[f"remeshed from {start} refinements"] = [
            solve(context, body, f"{body.dim}d-{start}-{tolerance:.3g}", *body.mesh(body.base * 2**start, 1), tolerance=tolerance)
            for tolerance in body.tolerances]
    rows = [(name, unknowns, energy - finest.energy, seconds) for name, curve in curves.items() for unknowns, energy, seconds in curve]
    errors = {name: [(unknowns, energy - finest.energy) for unknowns, energy, _ in curve] for name, curve in curves.items()}
    smallest = min(error for *_, error, _ in rows)
    yield Result(f"{body.name}: reference, what its next coarser mesh is off by, over the smallest error here",
                 (coarser.energy - finest.energy) / smallest, 0.1, finest.energy, None, f"{finest.unknowns} unknowns")
    slope = {name: -float(fitted_order(*np.array(curve).T)) for name, curve in errors.items()}
    for name in list(errors)[2:]:
        yield Result(f"{body.name}, {name}: slope of the error in unknowns", max(0.0, slope["graded meshes"] - slope[name]), 0.1,
                     slope[name], slope["graded meshes"],
                     ", ".join(f"{error:.3g} J of {unknowns}" for unknowns, error in errors[name])
                     + f"; uniform meshes {slope['uniform meshes']:.2f}")
    largest = min(max(unknowns for unknowns, _ in errors[name]) for name in list(errors)[2:])
    ends = [at(largest, errors[name]) for name in list(errors)[2:]]
    yield Result(f"{body.name}: largest over smallest error of the initial meshes, with {largest} unknowns", max(ends) / min(ends) - 1,
                 0.25, None, None, ", ".join(f"{end:.3g} J" for end in ends) + f"; graded meshes {at(largest, errors['graded meshes']):.3g} J")
    yield from by_n_refs(context, body, finest.energy)
    context.table(f"{body.dim}d", ["mesh", "unknowns", "error of the energy [J]", "processor seconds"],
                  [(name, unknowns, f"{error:.6g}", f"{seconds:.3g}") for name, unknowns, error, seconds in rows])
    context.figure(f"{body.dim}d", lambda axes: draw(axes, errors))


def draw(axes, errors):
    for (name, curve), style in zip(errors.items(), ("k.--", "k.:", "o-", "s-", "^-")):
        axes.loglog(*np.array(curve).T, style, label=name, markersize=4)
    axes.set(xlabel="unknowns", ylabel="error of the energy [J]")
    axes.legend(fontsize=7)


def results(context):
    yield from study(context, Membrane)
    yield from study(context, Bar)
