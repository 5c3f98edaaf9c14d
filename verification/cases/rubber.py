# SPDX-License-Identifier: MIT
"""Laws of rubber and foam: a block that is pulled and pressed, and a thick tube and a thick ball that are inflated."""
import numpy as np
from harness.scenes import box_mesh, oriented, run_scene, scene, write_mesh
from harness.suite import Result, compare

TITLE = "Laws of rubber against closed forms"
QUANTITY = "block: stretch across and energy; tube and ball: energy"
REFERENCE = "the least energy over the free stretches; integrals of incompressible inflation"
TOLERANCE = "1e-9 for blocks (linear elements are exact), 1 % for inflation"
NEEDS = ("meshio", "h5py", "scipy")

OGDEN = {"type": "Ogden", "mus": [0.63, 0.0012, -0.01], "alphas": [1.3, 5, -2]}


def powers(stretches, alpha, isochoric=True):
    scale = np.prod(stretches) ** (-1 / 3) if isochoric else 1
    return sum((scale * s) ** alpha for s in stretches) - 3


def bulk(stretches, K):
    J = np.prod(stretches)
    return K / 4 * (J**2 - 1 - 2 * np.log(J))


def yeoh(s, m):
    return sum(c * powers(s, 2) ** (i + 1) for i, c in enumerate(m["C"])) + bulk(s, m["K"])


def ogden(s, m):
    return sum(mu / a * powers(s, a) for mu, a in zip(m["mus"], m["alphas"])) + bulk(s, m["K"])


def arruda_boyce(s, m):
    I, series = powers(s, 2) + 3, (1 / 2, 1 / 20, 11 / 1050, 19 / 7000, 519 / 673750)
    return m["mu"] * sum(c * (I**i - 3**i) / m["lambda_m"] ** (2 * i - 2) for i, c in enumerate(series, 1)) + bulk(s, m["K"])


def mooney_rivlin(s, m):
    return m["c1"] * powers(s, 2) + m["c2"] * powers(s, -2) + bulk(s, m["K"])


def hencky(s, m):
    return m["mu"] * sum(np.log(a) ** 2 for a in s) + m["lambda"] / 2 * np.log(np.prod(s)) ** 2


def hyperfoam(s, m):
    terms = [(mu, a, nu / (1 - 2 * nu)) for mu, a, nu in zip(m["mus"], m["alphas"], m["nus"])]
    return sum(2 * mu / a**2 * (powers(s, a, False) + (np.prod(s) ** (-a * b) - 1) / b) for mu, a, b in terms)


LAWS = {
    "Yeoh": (yeoh, {"type": "Yeoh", "C": [0.31237, 5.4257e-4, 6.962e-5], "K": 30}),
    "Ogden": (ogden, {**OGDEN, "K": 30}),
    "Arruda-Boyce": (arruda_boyce, {"type": "ArrudaBoyce", "mu": 0.4, "lambda_m": 2.5, "K": 30}),
    "Mooney-Rivlin": (mooney_rivlin, {"type": "IsochoricMooneyRivlin", "c1": 0.2, "c2": 0.05, "K": 30}),
    "Hencky": (hencky, {"type": "Hencky", "lambda": 3, "mu": 0.4}),
    "hyperfoam": (hyperfoam, {"type": "Hyperfoam", "mus": [0.3, 0.2], "alphas": [8, -3], "nus": [0.1, 0.35]}),
}


def results(context):
    for name, (density, material) in LAWS.items():
        for dim in (2, 3):
            for stretch in (0.6, 1.8):
                yield from pull(context, name, density, material, dim, stretch)
    for name in ("Yeoh", "Ogden"):
        density, material = LAWS[name]
        for dim in (2, 3):
            yield inflate(context, name, density, {**material, "K": 1000}, dim)


def pull(context, name, density, material, dim, stretch):
    """Uniaxial: in 2D in plane stress, so that both free stretches are one in either dimension."""
    from scipy.optimize import minimize_scalar

    tag = f"{dim}d-{name.lower()}-{stretch}"
    points, cells = box_mesh([2] * dim, [1.0] * dim, jitter=0.2)
    write_mesh(context.folder / f"{tag}.msh", points, cells)
    rollers = [{"id": k, "value": [0] * dim, "dimension": [c == axis for c in range(dim)]}
               for axis, k in enumerate((1, 2, 5)[:dim])]
    pulled = {"id": 3, "value": [f"{stretch - 1} * t", 0, 0][:dim], "dimension": [True, False, False][:dim]}
    content = scene(context.folder / f"{tag}.msh", {**material, **({"plane_stress": True} if dim == 2 else {})},
                    boundary_conditions={"dirichlet_boundary": [*rollers, pulled]}, defaults="itr",
                    time={"dt": 0.25, "tend": 1, "quasistatic": True})
    run = run_scene(context, tag, content)
    least = minimize_scalar(lambda log: density((stretch, np.exp(log), np.exp(log)), material), bounds=(-1, 1), method="bounded",
                            options={"xatol": 1e-12})
    top = run.last().x[:, 1].max()
    label = f"{dim}D, {name}, stretch {stretch:g}"
    yield Result(f"{label}: stretch across", abs(top - np.exp(least.x)), 1e-7, top, np.exp(least.x))  # a minimum has half the digits
    yield compare(f"{label}: energy", run.steps[-1]["energy"]["elastic"], least.fun, 1e-9)


def sector(dim, rings, around):
    """A quarter of a tube or an eighth of a ball between the radii 1 and 2, of boxes bent to it."""
    if dim == 2:
        points, cells = box_mesh([rings, around], [1.0, 1.0])
        angle = np.pi / 2 * points[:, 1]
        points = (1 + points[:, :1]) * np.column_stack([np.cos(angle), np.sin(angle)])
        return points, oriented(points, cells)
    # The three faces of a cube that meet at its corner, each a box between its projections onto the spheres.
    points, cells = box_mesh([rings, around, around], [1.0, 1.0, 1.0])
    all_points, all_cells = [], []
    for axis in range(3):
        side = np.tan(np.pi / 4 * points[:, 1:])
        direction = np.insert(side, axis, 1.0, axis=1)
        direction /= np.linalg.norm(direction, axis=1, keepdims=True)
        all_cells.append(cells + len(points) * axis)
        all_points.append((1 + points[:, :1]) * direction)
    points = np.concatenate(all_points)
    _, first, same = np.unique(np.round(points, 9), axis=0, return_index=True, return_inverse=True)
    return points[first], oriented(points[first], same.ravel()[np.concatenate(all_cells)])


def inflate(context, name, density, material, dim):
    """The inner radius grows by half. Of an incompressible body, s^d - 1 falls as R^-d, s the stretch around."""
    from scipy.integrate import quad

    grown, tag = 1.5, f"{dim}d-{name.lower()}-inflated"
    points, cells = sector(dim, *((6, 12) if dim == 2 else (3, 5)))
    write_mesh(context.folder / f"{tag}.msh", points, cells)
    thin = lambda axis: [[-1e-6] * dim, [1e-6 if c == axis else 3 for c in range(dim)]]
    sides = [{"id": 10, "center": [0] * dim, "radius": 1.001}] + [{"id": 1 + c, "box": thin(c)} for c in range(dim)]
    rollers = [{"id": 1 + c, "value": [0] * dim, "dimension": [k == c for k in range(dim)]} for c in range(dim)]
    blown = {"id": 10, "value": [f"{grown - 1} * {c} * t" for c in "xyz"[:dim]]}
    content = scene(context.folder / f"{tag}.msh", material, 2, defaults="itr",
                    boundary_conditions={"dirichlet_boundary": [*rollers, blown]},
                    time={"dt": 0.25, "tend": 1, "quasistatic": True})
    content["geometry"][0]["surface_selection"] = sides
    run = run_scene(context, tag, content)

    def at(R):
        s = (1 + (grown**dim - 1) / R**dim) ** (1 / dim)
        return density((s, 1 / s, 1) if dim == 2 else (s, s, s**-2), material)

    expected = quad(lambda R: at(R) * (np.pi / 2) * R ** (dim - 1), 1, 2)[0]
    return compare(f"{dim}D, {name}, {'tube' if dim == 2 else 'ball'}: energy", run.steps[-1]["energy"]["elastic"], expected, 0.01)
