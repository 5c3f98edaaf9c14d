# SPDX-License-Identifier: MIT
"""Meshes and scenes for `itr`, and what a run of it leaves."""
import json
import pathlib

import numpy as np

from harness.suite import Failure


def box_mesh(counts, size, jitter=0.0, seed=0):
    """Points (n x d) and simplices (m x d+1) of a box [0, size]; interior points are moved by `jitter` cell sizes."""
    counts, size = np.array(counts), np.array(size, dtype=float)
    dim = len(counts)
    index = np.stack(np.meshgrid(*[np.arange(n + 1) for n in counts], indexing="ij"), axis=-1).reshape(-1, dim)
    inside = np.all((index > 0) & (index < counts), axis=1)
    moves = np.random.default_rng(seed).uniform(-jitter, jitter, index.shape) * inside[:, None]
    points = (index + moves) / counts * size
    strides = np.array([np.prod(counts[k + 1:] + 1) for k in range(dim)], dtype=int)
    corners = np.stack(np.meshgrid(*[np.arange(n) for n in counts], indexing="ij"), axis=-1).reshape(-1, dim) @ strides
    # Kuhn's subdivision: one simplex for each order of walking along the axes.
    orders = [(0, 1), (1, 0)] if dim == 2 else [(0, 1, 2), (0, 2, 1), (1, 0, 2), (1, 2, 0), (2, 0, 1), (2, 1, 0)]
    cells = [corners[:, None] + np.concatenate([[0], np.cumsum(strides[list(order)])]) for order in orders]
    return points, oriented(points, np.concatenate(cells))


def oriented(points, cells):
    """The cells with positive volume."""
    cells = np.array(cells)
    edges = points[cells[:, 1:]] - points[cells[:, :1]]
    flip = np.linalg.det(edges) < 0
    cells[flip, -2:] = cells[flip, -2:][:, ::-1]
    return cells


# Edges of a simplex with a node at each edge, in meshio's order.
EDGES = {2: [(0, 1), (1, 2), (0, 2)], 3: [(0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3)]}


def with_edge_nodes(points, cells):
    """Nodes and cells of the mesh with a node in the middle of each edge, and these edges. The nodes are numbered as the library
    numbers those of curved edges: after the vertices, in the order of their edges' ends."""
    pairs = np.sort(np.concatenate([cells[:, list(edge)] for edge in EDGES[points.shape[1]]]), axis=1)
    edges, of_cell = np.unique(pairs, axis=0, return_inverse=True)
    middles = len(points) + of_cell.reshape(-1, len(cells)).T
    return np.concatenate([points, points[edges].mean(axis=1)]), np.column_stack([cells, middles]), edges


def is_of_mixed_order(frame):
    """Whether some edges of a stored frame are curved and some straight."""
    vertices = frame.rest[:len(frame.rest) - len(frame.curved)]
    return 0 < len(frame.curved) < len(with_edge_nodes(vertices, frame.cells)[2])


def write_mesh(path, points, cells, bodies=None):
    import meshio
    dim = points.shape[1]
    tags = np.ones(len(cells), dtype=int) if bodies is None else np.asarray(bodies)
    flat = np.zeros((len(points), 3))
    flat[:, :dim] = points
    mesh = meshio.Mesh(flat, [("triangle" if dim == 2 else "tetra", cells)],
                       cell_data={"gmsh:physical": [tags], "gmsh:geometrical": [tags]})
    meshio.write(path, mesh, file_format="gmsh22", binary=False, float_fmt=".17g")


def scene(mesh, material, order=1, **parts):
    """A scene of one mesh file whose box sides are tagged 1 left, 2 bottom, 3 right, 4 top, 5 back, 6 front; solved as
    accurately as round-off lets it. `parts` are further top-level objects, replacing the ones here."""
    return {"geometry": [{"mesh": str(mesh), "surface_selection": {"threshold": 1e-6}}], "materials": material,
            "contact": {"enabled": False}, **({"space": {"discr_order": order}} if order != 1 else {}),
            "solver": {"nonlinear": {"x_delta": 1e-11, "grad_norm": 1e-300, "max_iterations": 200,
                                     "advanced": {"first_grad_norm_tol": 1e-300}}}, **parts}


def with_polyfem_defaults(content):
    """The scene with PolyFEM's defaults, but for the barrier's stiffness, which comes from the bodies: cases choose what they ask
    about, and no default of ITR changes their numbers."""
    content = {"defaults": "polyfem", **content}
    if content.get("contact", {}).get("enabled"):
        solver = content["solver"] = {**content.get("solver", {})}
        contact = solver.get("contact", {})
        if "initial_barrier_stiffness" not in contact:
            solver["contact"] = {"barrier_stiffness": "auto", **contact}
    return content


class Frame:
    """One stored step: t [s], rest (n x d) [m], cells, x, u [m], v [m/s]."""

    def __init__(self, path):
        import h5py
        with h5py.File(path) as file:
            self.t = float(file.attrs["t"])
            self.step = int(file.attrs["step"])
            self.rest, self.cells = file["mesh/rest"][()], file["mesh/simplices"][()]
            self.body = file["mesh/body"][()]
            self.curved = file["mesh/curved_edges"][()] if "mesh/curved_edges" in file else np.empty((0, 2), dtype=int)
            self.x, self.u, self.v = (file["fields/" + name][()] for name in ("x", "u", "v"))


class Run:
    """A folder that `itr run` has filled."""

    def __init__(self, folder):
        self.folder = pathlib.Path(folder)
        self.steps = [json.loads(line) for line in open(self.folder / "steps.jsonl")]
        self.summary = json.load(open(self.folder / "summary.json"))

    def frames(self):
        for path in sorted((self.folder / "frames").glob("*.h5")):
            yield Frame(path)

    def last(self):
        return Frame(max((self.folder / "frames").glob("*.h5")))


def write_scene(context, name, content):
    path = context.folder / f"{name}.json"
    path.write_text(json.dumps(with_polyfem_defaults(content), indent=1))
    return path


def run_scene(context, name, content, *overrides):
    """Runs a scene (a dictionary, or the path of a file) and returns the Run. Overrides are "/json/pointer=value"."""
    folder = context.folder / name
    path = write_scene(context, name, content) if isinstance(content, dict) else content
    arguments = [argument for override in overrides for argument in ("--set", override)]
    context.call("itr", "run", path, "-o", folder, "--overwrite", "--threads", 1, *arguments)
    if not (folder / "summary.json").exists():
        raise Failure(f"{folder} has no summary.json")
    return Run(folder)


def wheel_mesh(radius, corners):
    """Points and triangles of a regular polygon around the origin, in a ring of triangles and one of quadrilaterals."""
    angles = 2 * np.pi * np.arange(corners) / corners
    ring = np.column_stack([np.cos(angles), np.sin(angles)])
    points = np.concatenate([np.zeros((1, 2)), radius / 2 * ring, radius * ring])
    inner, outer = 1 + np.arange(corners), 1 + corners + np.arange(corners)
    cells = [(0, a, b) for a, b in zip(inner, np.roll(inner, -1))]
    for a, b, c, d in zip(inner, np.roll(inner, -1), outer, np.roll(outer, -1)):
        cells += [(a, c, d), (a, d, b)]
    return points, np.array(cells)
