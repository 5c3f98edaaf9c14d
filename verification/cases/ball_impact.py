# SPDX-License-Identifier: MIT
"""A quarter of an elastic ball that flies onto a rigid plane, far slower than its waves: Hertz's impact in 3D."""
import h5py
import numpy as np
from harness.bisection import ball
from harness.contact import with_obstacle, write_plane
from harness.fields import volumes
from harness.scenes import run_scene, scene, write_mesh
from harness.suite import Failure, Result, compare

TITLE = "Hertz's impact of a ball on a plane"
QUANTITY = "duration by the spread of the force over time; largest approach of the centre of mass and largest force; rebound"
REFERENCE = "approach (15 m v^2 / (16 E* sqrt R))^(2/5), force 4/3 E* sqrt R approach^(3/2), 2.943 approach / v (Johnson 1985, 11.4)"
TOLERANCE = "finest mesh: duration 1 %, approach and force 2 %; the limit of small contacts 1 %; other integrators and remeshing as stated"
NEEDS = ("meshio", "h5py", "scipy")

R, YOUNG, NU, RHO = 1.0, 1.0, 0.3, 1.0  # waves run along bars with 1 m/s
STIFFNESS = 4 / 3 * YOUNG / (1 - NU**2) * np.sqrt(R)
APPROACH = 1e-4  # of Hertz's impact. Ball and half-space differ by the contact's radius over R, here a hundredth


def hertz_times():
    """Duration, and the spread of the force over time, by approach / speed; and the force over time: pairs of time from the largest
    one, force by the largest."""
    from scipy.integrate import quad
    # Time from the turning point by the approach, 1 - y^2 of the largest, which takes the rate's pole away.
    rate = lambda y: 2 * y / np.sqrt(1 - (1 - y**2)**2.5) if y > 0 else 2 / np.sqrt(2.5)
    time = lambda y: quad(rate, 0, y)[0]
    force = lambda y: (1 - y**2)**1.5
    impulse, second = (quad(lambda y: force(y) * time(y)**k * rate(y), 0, 1)[0] for k in (0, 2))
    return 2 * time(1), np.sqrt(second / impulse), [(time(y), force(y)) for y in np.linspace(0, 1, 50)]


class Impact:
    """With cells of a size h, in radii of the contact, under it, in so many steps over the contact. Of the run: times, the plane's force
    on the whole ball; in Hertz's: duration, approach, force, rebound."""

    def __init__(self, context, h, steps, approach=APPROACH, integrator="ImplicitNewmark", remesh=None):
        radius, pole, dhat = np.sqrt(R * approach), np.array([0, 0, -R]), 1e-3 * approach
        points, cells = ball(R, lambda x: np.maximum(h * radius, 0.35 * (np.linalg.norm(x - pole, axis=1) - radius)),
                             [[1, 1, -1], [1, 1, 1]])
        mass = 4 * RHO * volumes(points, cells).sum()
        speed = np.sqrt(0.8 * STIFFNESS * approach**2.5 / mass)
        duration, spread, self.curve = hertz_times()
        self.scale = approach / speed
        name = f"ball-{approach:g}-{h:g}-{steps}-{integrator}-{remesh}"
        mesh, plane = context.folder / f"{name}.msh", context.folder / "plane.obj"
        write_mesh(mesh, points, cells)
        write_plane(plane, -R - dhat)
        content = scene(mesh, {"type": "LinearElasticity", "E": YOUNG, "nu": NU, "rho": RHO},
                        boundary_conditions={"dirichlet_boundary": [
                            {"id": 1, "value": [0, 0, 0], "dimension": [True, False, False]},
                            {"id": 2, "value": [0, 0, 0], "dimension": [False, True, False]}]},
                        initial_conditions={"velocity": [{"id": 1, "value": [0, 0, -speed]}]},
                        time={"dt": duration * self.scale / steps, "time_steps": round(1.15 * steps), "integrator": integrator},
                        output={"paraview": {"options": {"contact_forces": True, "momentum": True}}})
        content["solver"]["nonlinear"]["x_delta"] = 1e-7 * speed
        content["solver"]["linear"] = {"solver": ["cholmod", "eigen"]}
        if remesh:
            energy = 0.5 * mass / 4 * speed**2
            content["space"] = {"remesh": {"enabled": True, "split": {"acceptance_tolerance": remesh * energy},
                                           "collapse": {"acceptance_tolerance": -0.01 * remesh * energy}}}
        run = run_scene(context, name, with_obstacle(content, plane, dhat, 10 * YOUNG))
        self.t, self.force, velocity = np.array([self.state(path, mass) for path in sorted((run.folder / "frames").glob("*.h5"))]).T
        self.middle = (self.force * self.t).sum() / self.force.sum()
        found = np.sqrt((self.force * (self.t - self.middle)**2).sum() / self.force.sum())
        depth = -np.cumsum(np.diff(self.t) * (velocity[1:] + velocity[:-1]) / 2).min() - dhat
        self.largest = STIFFNESS * approach**1.5
        self.duration, self.approach = float(found / (spread * self.scale)), float(depth / approach)
        self.peak, self.rebound = float(self.force.max() / self.largest), float(velocity[-1] / speed)
        self.vertices, self.seconds = run.steps[-1]["vertices"], sum(step["processor_seconds"] for step in run.steps)
        self.row = [integrator, "" if remesh is None else remesh, approach, h, steps, self.vertices,
                    *(f"{x:.5g}" for x in (self.seconds, self.duration, self.approach, self.peak, self.rebound))]
        self.note = f"{self.vertices} vertices, {self.seconds:.0f} processor seconds, rebound {self.rebound:.4f}"
        if self.force[-1] != 0:
            raise Failure(f"{name}: still in contact at the end")

    @staticmethod
    def state(path, mass):
        """Time, force of the plane on the whole ball, speed of its centre of mass."""
        with h5py.File(path) as file:
            return (float(file.attrs["t"]), 4 * file["fields/contact_force"][()][:, 2].sum(),
                    4 * float(file["totals/momentum"][()].ravel()[2]) / mass)


def judge(label, impact, tolerance):
    yield compare(f"{label}: duration", impact.duration, 1, tolerance, impact.note)
    yield compare(f"{label}: largest approach", impact.approach, 1, 2 * tolerance)
    yield compare(f"{label}: largest force", impact.peak, 1, 2 * tolerance)


def results(context):
    if context.quick:
        yield from judge("cells of half the contact's radius", Impact(context, 0.5, 40), 0.03)
        return
    runs = {(h, steps): Impact(context, h, steps) for h, steps in ((0.5, 50), (0.35, 50), (0.25, 100))}
    finest = runs[0.25, 100]
    yield from judge("finest mesh", finest, 0.01)
    yield Result("finest mesh: speed of the rebound", abs(finest.rebound - 1), 1e-3, finest.rebound, 1)
    # The force on a ball decays within the ball, not in a half-space: a share of the contact's radius over R.
    shares = [0.05, 0.025, 0.01]
    by_size = [Impact(context, 0.35, 50, R * share**2) for share in shares[:2]] + [runs[0.35, 50]]
    for what in ("duration", "approach", "peak"):
        values = [getattr(run, what) for run in by_size]
        limit = float(np.polyfit(shares, values, 1)[1])
        yield compare(f"limit of small contacts, cells of 0.35 of the contact's radius: {what}", limit, 1, 0.01,
                      ", ".join(f"{v:.4f}" for v in values) + f" at {', '.join(map(str, shares))} R")
    others = [Impact(context, 0.5, steps, integrator=rule) for rule in ("BDF2", "ImplicitEuler") for steps in (50, 100)]
    for run in others:
        yield compare(f"{run.row[0]}, {run.row[4]} steps: duration", run.duration, 1, None, f"force {run.peak:.4f}, " + run.note)
    remeshed = [Impact(context, 0.7, 50, remesh=tolerance) for tolerance in (None, 1e-3, 1e-4)]
    for run in remeshed:
        yield compare(f"from cells of 0.7, remeshed to {run.row[1] or 'nothing'} of the energy: duration", run.duration, 1, None,
                      f"approach {run.approach:.4f}, force {run.peak:.4f}, " + run.note)
    context.table("runs", ["integrator", "remesh", "approach / R", "h / a", "steps", "vertices", "seconds", "duration", "approach",
                           "force", "rebound"], [run.row for run in [*runs.values(), *by_size[:2], *others, *remeshed]])
    context.figure("force", lambda axes: draw(axes, finest))


def draw(axes, impact):
    t, force = np.array(impact.curve).T
    axes.plot(np.concatenate([-t[::-1], t]), np.concatenate([force[::-1], force]), "k--", label="Hertz")
    axes.plot((impact.t - impact.middle) / impact.scale, impact.force / impact.largest, ".-", label="ITR, Newmark")
    axes.set(xlabel="t v / approach", ylabel="force / largest")
    axes.legend()
