# SPDX-License-Identifier: MIT
"""A beam whose clamped end shakes, remeshed inside every step by all operations: every step is checked by itself, from
the stored state before it to the stored state after it."""
import numpy as np
import ufl
from harness.dynamics import BDF
from harness.fenicsx import Body
from harness.materials import lame, neo_hookean
from harness.projection import Projection
from harness.scenes import box_mesh, run_scene, scene, write_mesh
from harness.suite import Failure, Result

TITLE = "Steps with remeshing, handed to FEniCSx"
QUANTITY = ("velocity of each step, which the projected history enters, relative to the largest; residual of the step's "
            "equations relative to the largest force in them")
REFERENCE = "FEniCSx: its projection of the history from the mesh before, its form on the mesh after"
TOLERANCE = 1e-8
NEEDS = ("dolfinx", "meshio", "h5py", "scipy")

E, NU, RHO, H, GRAVITY, LENGTH = 2e5, 0.4, 1000.0, 0.01, -9.81, 1.2
SHAKE = 0.05
RULES = ["ImplicitEuler", "ImplicitNewmark", "BDF2"]
REMESH = {"enabled": True, "split": {"acceptance_tolerance": 0.02, "culling_threshold": 0.7},
          "collapse": {"acceptance_tolerance": -0.02, "culling_threshold": 0.3, "rel_max_edge_length": 10},
          "swap": {"enabled": True}, "smooth": {"enabled": True}}


def scene_of(mesh, rule, steps):
    # Where shaking and coarsening make energy, steps of implicit Euler would take the place of Newmark's: not here.
    integrator = {"type": rule, "energy_growth_limit": 1e300} if rule == "ImplicitNewmark" else rule
    return scene(mesh, {"type": "NeoHookean", "E": E, "nu": NU, "rho": RHO},
                 boundary_conditions={"rhs": [0, -GRAVITY],
                                      "dirichlet_boundary": [{"id": 1, "value": [0, f"{SHAKE} * sin(20 * t)"]}]},
                 time={"dt": H, "time_steps": steps, "integrator": integrator}, space={"remesh": REMESH})


class Reference:
    """The history of a run on its present mesh: u and v as stored, what is older as FEniCSx projects it."""

    def __init__(self, frame, rule):
        self.rule, self.mesh = rule, (frame.rest, frame.cells)
        self.us, self.vs, self.a = [frame.u], [frame.v], np.zeros_like(frame.u)

    def move_to(self, frame, t):
        """Projects everything onto the mesh of the next frame; t is the time of the present state."""
        mesh = (frame.rest, frame.cells)
        if np.array_equal(mesh[0], self.mesh[0]) and np.array_equal(mesh[1], self.mesh[1]):
            return False
        project = Projection(self.mesh, mesh, *(np.full(len(cells), RHO) for _, cells in (self.mesh, mesh)))
        clamped = np.isclose(frame.rest[:, 0], 0)
        for k, u in enumerate(self.us):
            held = np.zeros_like(frame.u)
            held[:, 1] = SHAKE * np.sin(20 * (t - k * H))
            self.us[k] = project(u, clamped, held)
        self.vs = [project(v) for v in self.vs]
        self.a = project(self.a)
        self.mesh = mesh
        return True

    def rates(self, u):
        """Velocity and acceleration at the end of the step that leads to u."""
        if self.rule == "ImplicitNewmark":
            a = 4 / H**2 * (u - self.us[0] - H * self.vs[0]) - self.a
            return self.vs[0] + H / 2 * (self.a + a), a
        c = BDF[min(2 if self.rule == "BDF2" else 1, len(self.us))]
        derivative = lambda new, past: (c[0] * new + sum(w * x for w, x in zip(c[1:], past))) / H
        v = derivative(u, self.us)
        return v, derivative(v, self.vs)

    def push(self, frame, a):
        keep = 2 if self.rule == "BDF2" else 1
        self.us, self.vs, self.a = [frame.u, *self.us][:keep], [frame.v, *self.vs][:keep], a


def check(frame, a):
    """Largest residual of the step's equations at free vertices, relative to the largest force that enters them."""
    body = Body(frame.rest, frame.cells, neo_hookean, lame(E, NU, 2), RHO)
    gravity = body.load(RHO * ufl.inner(ufl.as_vector([0, GRAVITY]), body.test) * ufl.dx)()
    forces = [body.mass_matrix @ a.ravel(), body.internal_force(frame.u), -gravity]
    free = np.repeat(~np.isclose(frame.rest[:, 0], 0), 2)
    return np.abs(sum(forces))[free].max() / max(np.abs(f)[free].max() for f in forces)


def results(context):
    points, cells = box_mesh([12, 3], [LENGTH, 0.3], jitter=0.2)
    mesh = context.folder / "beam.msh"
    write_mesh(mesh, points, cells)
    for rule in RULES:
        run = run_scene(context, rule, scene_of(mesh, rule, 12 if context.quick else 40))
        done = {kind: sum(step[kind]["accepted"] for step in run.steps) for kind in ("splits", "collapses", "swaps", "smooths")}
        if not all(done.values()):
            raise Failure(f"{rule}: the scene is to use every operation, but accepted {done}")
        frames = list(run.frames())
        reference = Reference(frames[0], rule)
        differences, residuals, remeshed, fastest = [], [], 0, 0
        for before, frame in zip(frames, frames[1:]):
            remeshed += reference.move_to(frame, before.t)
            v, a = reference.rates(frame.u)
            differences.append(np.abs(v - frame.v).max())
            residuals.append(check(frame, a))
            fastest = np.maximum(fastest, np.abs(frame.v).max())
            reference.push(frame, a)
        note = f"{remeshed} of {len(frames) - 1} steps remeshed, " + ", ".join(f"{n} {kind}" for kind, n in done.items())
        yield Result(f"{rule}, velocity (projected history)", float(np.max(differences) / fastest), TOLERANCE, note=note)
        yield Result(f"{rule}, residual", float(np.max(residuals)), TOLERANCE)
