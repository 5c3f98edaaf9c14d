#!/usr/bin/python3
# SPDX-License-Identifier: MIT
"""Scores results of the hard-contact set. Needs Python and numpy (meshio for VTU files), and nothing of ITR.

python3 score.py SCENES RESULTS [--scene PART-OF-NAME]... [--csv FILE]

SCENES is the folder that make.py wrote, RESULTS has a folder for each scene that was run. README.md describes both. Signs of areas
and volumes are exact: by floating-point numbers where these cannot be wrong, by whole numbers of any length elsewhere.
"""
import argparse
import csv
import dataclasses
import json
import math
import os
import pathlib
import sys

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # matrices have at most 3 rows
import numpy as np  # noqa: E402

MOMENTUM_BAR = 1e-3             # change that nothing explains, by all momentum that there was
ENERGY_BAR = 1e-2               # growth by the energy that is stored
SETUP_BAR = 1e-6                # of places that are prescribed, by the scene's extent; of volumes at rest


# --- exact signs -----------------------------------------------------------------------------------------------------

def determinant(m):
    """Of matrices of 2 or 3 rows, and the sum of the sizes of its products."""
    if m.shape[1] == 2:
        plus, minus = m[:, 0, 0] * m[:, 1, 1], m[:, 0, 1] * m[:, 1, 0]
        return plus - minus, abs(plus) + abs(minus)
    a, b, c = m[:, 0], m[:, 1], m[:, 2]
    plus, minus = b[:, [1, 2, 0]] * c[:, [2, 0, 1]], b[:, [2, 0, 1]] * c[:, [1, 2, 0]]
    return (a * (plus - minus)).sum(axis=1), (abs(a) * (abs(plus) + abs(minus))).sum(axis=1)


def sure_orientation(*points):
    """Signs of the simplices of d+1 arrays (n x d): 1 where vertices turn to the left (3D: are right-handed); 0 where floating-point
    numbers cannot tell. Round-off is below 4e-16 (3D: 8e-16) of the size (Shewchuk 1997) where nothing underflows."""
    value, size = determinant(np.stack([p - points[0] for p in points[1:]], axis=1))
    return np.where((np.abs(value) > (2e-15 if len(points) == 4 else 1e-15) * size) & (size > 1e-250), np.sign(value), 0).astype(int)


def exact_orientation(*points):
    """The same by whole numbers of any length: 0 only where the simplex is flat."""
    mantissas, exponents = np.frexp(np.stack(points, axis=1))
    whole = (mantissas * 2.0**53).astype(np.int64).astype(object)
    shift = np.where(mantissas == 0, exponents.max(initial=0), exponents)
    whole = whole << (shift - shift.min(initial=0)).astype(object)
    return np.sign(determinant(whole[:, 1:] - whole[:, :1])[0]).astype(int)


def orientation(*points):
    """The same, exact only where that is needed."""
    signs = sure_orientation(*points)
    doubt = np.flatnonzero(signs == 0)
    if len(doubt):
        signs[doubt] = exact_orientation(*(p[doubt] for p in points))
    return signs


# --- what meets what -------------------------------------------------------------------------------------------------

def boxes(x, simplices):
    corners = x[simplices]
    return corners.min(axis=1), corners.max(axis=1)


def overlapping(a, b):
    """Pairs (i, j) of boxes of two lists (low, high) that overlap: a sweep along one axis, large boxes of b one by one."""
    (low, high), (low_b, high_b) = a, b
    found = [np.empty((0, 2), dtype=int)]
    if not len(low) or not len(low_b):
        return found[0]

    def keep(i, j):
        met = ((low[i] <= high_b[j]) & (low_b[j] <= high[i])).all(axis=1)
        found.append(np.column_stack([i[met], j[met]]))

    axis = int(np.argmax(np.ptp(np.concatenate([low, low_b]), axis=0)))
    width = (high_b - low_b)[:, axis]
    for j in np.flatnonzero(width > 8 * np.median(width)):
        keep(np.arange(len(low)), np.full(len(low), j))
    small = np.flatnonzero(width <= 8 * np.median(width))
    small = small[np.argsort(low_b[small, axis], kind="stable")]
    if len(small):
        starts = low_b[small, axis]
        first = np.searchsorted(starts, low[:, axis] - width[small].max(), "left")
        count = np.searchsorted(starts, high[:, axis], "right") - first
        for part in np.array_split(np.arange(len(low)), 1 + int(count.sum()) // 2_000_000):
            i = np.repeat(part, count[part])
            offsets = np.arange(len(i)) - np.repeat(np.cumsum(count[part]) - count[part], count[part])
            keep(i, small[np.repeat(first[part], count[part]) + offsets])
    return np.concatenate(found)


def segments_meet(a, b, c, d):
    """Whether closed segments ab and cd in the plane share a point."""
    c_, d_, a_, b_ = orientation(a, b, c), orientation(a, b, d), orientation(c, d, a), orientation(c, d, b)
    flat = (c_ == 0) & (d_ == 0) & (a_ == 0) & (b_ == 0)
    in_line = ((np.minimum(a, b) <= np.maximum(c, d)) & (np.minimum(c, d) <= np.maximum(a, b))).all(axis=1)
    return np.where(flat, in_line, (c_ * d_ <= 0) & (a_ * b_ <= 0))


def shadows(triangles, *points):
    """Corners and points without a coordinate, so chosen that the triangle's shadow has an area, and the sign of this area."""
    chosen, sign = np.tile([0, 1], (len(triangles[0]), 1)), np.zeros(len(triangles[0]), dtype=int)
    for axes in ([0, 1], [1, 2], [2, 0]):
        new = np.where(sign == 0, orientation(*(t[:, axes] for t in triangles)), 0)
        chosen[new != 0] = axes
        sign += new
    return [np.take_along_axis(p, chosen, axis=1) for p in (*triangles, *points)], sign


def meet_in_plane(p, q, a, b, c):
    """Whether segments in the planes of triangles meet them."""
    (a, b, c, p, q), sign = shadows((a, b, c), p, q)
    sides = [(a, b), (b, c), (c, a)]
    within = np.all([sign * orientation(u, v, p) >= 0 for u, v in sides], axis=0)
    return within | np.any([segments_meet(p, q, u, v) for u, v in sides], axis=0)


def segments_meet_triangles(p, q, a, b, c):
    """Whether closed segments pq and closed triangles abc in space share a point."""
    asked = [(a, b, c, p), (a, b, c, q), (p, q, a, b), (p, q, b, c), (p, q, c, a)]
    met = np.zeros(len(p), dtype=bool)
    sure = np.array([sure_orientation(*points) for points in asked])
    k = np.flatnonzero((sure[0] * sure[1] <= 0) & ~((sure[2:] > 0).any(axis=0) & (sure[2:] < 0).any(axis=0)))
    signs = np.array([orientation(*(point[k] for point in points)) for points in asked])
    met[k] = (signs[0] * signs[1] <= 0) & ~((signs[2:] > 0).any(axis=0) & (signs[2:] < 0).any(axis=0))
    flat = k[met[k] & (signs[0] == 0) & (signs[1] == 0)]
    met[flat] = meet_in_plane(*(point[flat] for point in (p, q, a, b, c)))
    return met


def folded(common, end, *facet):
    """Whether segments, and edges (triangles) that share the vertices `common` with them, lie on each other."""
    lies = orientation(common, end, *facet) == 0
    k = np.flatnonzero(lies)
    common, end, *facet = (point[k] for point in (common, end, *facet))
    if len(facet) == 1:
        axis = (facet[0][:, :1] == common[:, :1]).astype(int)
        along = lambda point: np.take_along_axis(point < common, axis, axis=1)[:, 0]  # noqa: E731
        lies[k] = along(facet[0]) == along(end)
        return lies
    (common, first, second, end), sign = shadows((common, *facet), end)
    lies[k] = (sign * orientation(common, first, end) >= 0) & (sign * orientation(common, end, second) >= 0)
    return lies


def boundary(simplices):
    """Facets of one simplex only."""
    facets = np.concatenate([np.delete(simplices, k, axis=1) for k in range(simplices.shape[1])])
    _, first, count = np.unique(np.sort(facets, axis=1), axis=0, return_index=True, return_counts=True)
    return facets[first[count == 1]]


def edges_of(triangles):
    pairs = np.sort(np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [0, 2]]]), axis=1)
    return np.unique(pairs, axis=0)


def inversions(x, simplices):
    """Numbers of simplices that are inverted or flat."""
    return np.flatnonzero(orientation(*(x[simplices[:, k]] for k in range(simplices.shape[1]))) <= 0)


def crossings(x, segments, facets, obstacle):
    """Pairs (segment, facet) that share a point without sharing a vertex, or lie on each other; `obstacle`: first vertex of
    obstacles, which may cross each other. In 2D facets are the segments."""
    pairs = overlapping(boxes(x, segments), boxes(x, facets))
    s, f = segments[pairs[:, 0]], facets[pairs[:, 1]]
    common = (s[:, :, None] == f[:, None, :]).sum(axis=(1, 2))
    asked = (common <= 1) & ~((s[:, 0] >= obstacle) & (f[:, 0] >= obstacle))
    if facets.shape[1] == 2:
        asked &= (pairs[:, 0] < pairs[:, 1])
    pairs, s, f, common = pairs[asked], s[asked], f[asked], common[asked]
    met = np.zeros(len(pairs), dtype=bool)
    apart, touching = np.flatnonzero(common == 0), np.flatnonzero(common == 1)
    test = segments_meet if facets.shape[1] == 2 else segments_meet_triangles
    met[apart] = test(*(x[s[apart, k]] for k in range(2)), *(x[f[apart, k]] for k in range(facets.shape[1])))
    s, f = s[touching], f[touching]
    shared = (s[:, :, None] == f[:, None, :])
    s = np.take_along_axis(s, np.argsort(~shared.any(axis=2), axis=1, kind="stable"), axis=1)  # the common vertex comes first
    f = np.take_along_axis(f, np.argsort(~shared.any(axis=1), axis=1, kind="stable"), axis=1)
    met[touching] = folded(x[s[:, 0]], x[s[:, 1]], *(x[f[:, k]] for k in range(1, facets.shape[1])))
    return pairs[met]


def insides(x, points, simplices):
    """Pairs (vertex, simplex) where a vertex is in or on a simplex that it does not belong to. Where no simplex is inverted and
    no surfaces cross, this finds what is wholly inside of something."""
    pairs = overlapping((x[points], x[points]), boxes(x, simplices))
    v, cells = points[pairs[:, 0]], simplices[pairs[:, 1]]
    own = (cells == v[:, None]).any(axis=1)
    v, cells, pairs = v[~own], cells[~own], pairs[~own]
    inside = np.ones(len(v), dtype=bool)
    for test in (sure_orientation, orientation):
        for k in range(simplices.shape[1]):
            left = np.flatnonzero(inside)
            inside[left] = test(*(x[cells[left, i]] if i != k else x[v[left]] for i in range(simplices.shape[1]))) >= 0
    return np.column_stack([v[inside], pairs[inside, 1]])


def check_validity(x, simplices, obstacle):
    """(simplices that are not positive, crossings of surfaces, vertices inside), the last two as pairs; `obstacle`: positions, edges and
    faces. Insides are asked only where the rest is valid."""
    wrong = inversions(x, simplices)
    points, edges, faces = obstacle
    whole = np.concatenate([x, points])
    surface = boundary(simplices)
    free_edges = np.asarray(edges, dtype=int).reshape(-1, 2) + len(x)
    if x.shape[1] == 2:
        segments = facets = np.concatenate([surface, free_edges])
    else:
        facets = np.concatenate([surface, np.asarray(faces, dtype=int).reshape(-1, 3) + len(x)])
        segments = np.concatenate([edges_of(facets), free_edges])
    crossed = crossings(whole, segments, facets, len(x))
    if len(wrong) or len(crossed):
        return wrong, crossed, np.empty((0, 2), dtype=int)
    asked = np.concatenate([np.unique(surface), np.arange(len(x), len(whole))])
    return wrong, crossed, insides(whole, asked, simplices)


# --- scenes and results ----------------------------------------------------------------------------------------------

NAMES = {name: getattr(np, name) for name in ("sin", "cos", "tan", "sqrt", "exp", "abs", "pi")} | {"min": np.minimum, "max": np.maximum}


def displacement(expressions, rest, t):
    """Values (n x d) of expressions of x, y, z and t; NaN where a component is free (None)."""
    given = {"t": t, **dict(zip("xyz", rest.T))}
    columns = [np.full(len(rest), np.nan) if e is None else
               np.broadcast_to(eval(str(e), {"__builtins__": {}}, NAMES | given), len(rest)) for e in expressions]  # noqa: S307
    return np.column_stack(columns)


class Scene:
    def __init__(self, folder):
        self.about = json.loads((folder / "scene.json").read_text())
        with np.load(folder / "mesh.npz") as mesh:
            self.points, self.simplices, self.body = mesh["points"], mesh["simplices"], mesh["body"]
            self.obstacle_points, self.edges, self.faces, self.obstacle = (
                mesh["obstacle_" + name] for name in ("points", "edges", "faces", "of_point"))
        self.dim, self.extent = self.points.shape[1], float(np.ptp(self.points, axis=0).max())
        self.gravity = np.array(self.about["gravity"])
        self.bodies = range(1, len(self.about["bodies"]) + 1)
        self.quasistatic = self.about["time"]["quasistatic"]

    def obstacles(self, t):
        x = self.obstacle_points.copy()
        for number, obstacle in enumerate(self.about["obstacles"], 1):
            mine = self.obstacle == number
            if obstacle["displacement"] is not None:
                x[mine] += displacement(obstacle["displacement"], x[mine], t)
        return x, self.edges, self.faces

    def field(self, name, body):
        """A number of each body's material, by simplex."""
        return np.array([material[name] for material in self.about["bodies"]])[body - 1]


@dataclasses.dataclass
class Frame:
    t: float
    rest: np.ndarray
    x: np.ndarray
    simplices: np.ndarray
    body: np.ndarray
    v: np.ndarray | None = None


def read_npz(path):
    """Frames of a file: of one, or of all where `x` has three dimensions."""
    with np.load(path) as file:
        arrays = {name: file[name] for name in file.files}
    x, t = arrays["x"], np.atleast_1d(arrays["t"])
    if arrays["simplices"].shape[1] != x.shape[-1] + 1:
        sys.exit(f"{path}: simplices of {arrays['simplices'].shape[1]} nodes; split those of higher order at their nodes")
    many = x if x.ndim == 3 else x[None]
    v = arrays.get("v")
    v = [None] * len(many) if v is None else v if v.ndim == 3 else v[None]
    cells = arrays["simplices"].astype(int)
    body = arrays.get("body", np.ones(len(cells), dtype=int))
    return [Frame(float(t[k]), arrays["rest"], many[k], cells, body, v[k]) for k in range(len(many))]


def read_vtu(path, dim):
    import meshio
    mesh = meshio.read(path)
    kind = "triangle" if dim == 2 else "tetra"
    rest, u, v = mesh.points[:, :dim], mesh.point_data["u"], mesh.point_data.get("v")
    body = mesh.cell_data_dict.get("body", {}).get(kind, np.ones(len(mesh.cells_dict[kind]), dtype=int))
    return Frame(math.nan, rest, rest + u[:, :dim], mesh.cells_dict[kind], np.ravel(body), None if v is None else v[:, :dim])


def read_frames(folder, about, dim):
    """All frames in the order of their files' names; frames of VTU have their times in result.json."""
    if (folder / "frames.npz").exists():
        return read_npz(folder / "frames.npz")
    frames = [frame for path in sorted(folder.glob("frame*.npz")) for frame in read_npz(path)]
    frames += [read_vtu(path, dim) for path in sorted(folder.glob("*.vtu"))]
    for frame, t in zip(frames, about.get("times", [])):
        frame.t = t
    return frames


# --- momentum and energy ---------------------------------------------------------------------------------------------

def matrices(x, simplices):
    return np.swapaxes(x[simplices[:, 1:]] - x[simplices[:, :1]], 1, 2)


@dataclasses.dataclass
class State:
    """Of a frame."""
    t: float
    mass: float
    middle: np.ndarray     # of all masses
    momentum: np.ndarray
    moving: float          # sum of sizes of momenta
    kinetic: float
    elastic: float
    weight: float          # energy of it
    centre: np.ndarray     # of the masses, by body (b x d)
    volume_ratio: float    # the smallest
    contact: float = 0.0
    forces: dict | None = None


def state_of(scene, frame, before):
    d = scene.dim
    rest, now = matrices(frame.rest, frame.simplices), matrices(frame.x, frame.simplices)
    volume = np.linalg.det(rest) / math.factorial(d)
    mass = volume * scene.field("rho", frame.body)
    v = frame.v
    if v is None:  # as implicit Euler has it
        same = before is not None and before.x.shape == frame.x.shape
        v = (frame.x - before.x) / (frame.t - before.t) if same else np.zeros_like(frame.x)
    corners = v[frame.simplices]
    F = now @ np.linalg.inv(rest)
    J = np.linalg.det(F)
    mu, lam = scene.field("mu", frame.body), scene.field("lambda", frame.body)
    with np.errstate(divide="ignore", invalid="ignore"):
        density = mu / 2 * ((F**2).sum(axis=(1, 2)) - d - 2 * np.log(J)) + lam / 2 * np.log(J)**2
    middle = frame.x[frame.simplices].mean(axis=1)
    squares = (corners**2).sum(axis=(1, 2)) + (corners.sum(axis=1)**2).sum(axis=1)
    momenta = mass[:, None] * corners.mean(axis=1)
    centre = np.array([np.average(middle[frame.body == b], axis=0, weights=mass[frame.body == b]) for b in scene.bodies])
    return State(frame.t, mass.sum(), np.average(middle, axis=0, weights=mass), momenta.sum(axis=0),
                 float(np.linalg.norm(momenta, axis=1).sum()),
                 float((mass * squares).sum() / (2 * (d + 1) * (d + 2))), float((volume * density).sum()),
                 float(-(mass[:, None] * middle).sum(axis=0) @ scene.gravity), centre, float(J.min()))


def momentum_error(scene, states):
    """Largest of: the change of momentum that weight does not explain, along axes on which nothing else can act; and what is between
    mass times the motion of its centre and the momenta before and after a step. By all momentum that there was."""
    if scene.quasistatic:
        return math.nan
    axes, first, worst, size = scene.about["momentum_axes"], states[0], 0.0, 1e-300
    for before, state in zip([first, *states], states):
        weight = state.mass * scene.gravity * (state.t - first.t)
        size = max(size, state.moving, np.linalg.norm(weight))
        worst = max([worst, *np.abs(state.momentum - first.momentum - weight)[axes]])
        if state.t > before.t:
            moved = state.mass * (state.middle - before.middle) / (state.t - before.t)
            low, high = np.minimum(before.momentum, state.momentum), np.maximum(before.momentum, state.momentum)
            worst = max(worst, *(low - moved), *(moved - high))
    return worst / size


def energy_growth(scene, states):
    """Largest growth of the energy above what it was before, by the energy of motion, strain and contact so far; NaN if driven."""
    if scene.about["driven"]:
        return math.nan
    least, worst, size = math.inf, 0.0, 1e-300
    for state in states:
        stored = (0.0 if scene.quasistatic else state.kinetic) + state.elastic + state.contact
        size = max(size, abs(stored))
        least = min(least, stored + state.weight)
        worst = max(worst, stored + state.weight - least) if math.isfinite(stored) else math.inf
    return worst / size


# --- verdicts --------------------------------------------------------------------------------------------------------

def value_of(reference, states):
    """What a reference asks for; None where the results do not have it."""
    state = min(states, key=lambda s: abs(s.t - reference["at"]))
    name = reference["of"]
    if name == "centre":
        start = states[0].centre if reference.get("moved") else np.zeros_like(state.centre)
        return float((state.centre - start)[reference["body"] - 1][reference["axis"]])
    if name == "force":
        force = state.forces.get(reference["on"])
        return None if force is None else float(force[reference["axis"]])
    if name == "momentum":
        return float(state.momentum[reference["axis"]])
    if name == "volume ratio":
        return min(s.volume_ratio for s in states)
    return float({"elastic energy": state.elastic, "kinetic energy": state.kinetic}[name])


def setup_error(scene, frames):
    """Largest of: volumes at rest off the described ones, and held vertices of the last frame off their places, in shares of them."""
    worst, last = 0.0, frames[-1]
    d = math.factorial(scene.dim)
    for b in scene.bodies:
        of = lambda mesh, cells, body: np.linalg.det(matrices(mesh, cells))[body == b].sum() / d  # noqa: E731
        asked = of(scene.points, scene.simplices, scene.body)
        worst = max(worst, *(abs(of(f.rest, f.simplices, f.body) / asked - 1) for f in (frames[0], last)))
    for held in scene.about["held"]:
        rest = scene.points[held["nodes"]]
        moved = displacement(held["displacement"], rest, last.t)
        for place, way in zip(rest, moved):
            nearest = np.linalg.norm(last.rest - place, axis=1).argmin()
            if np.linalg.norm(last.rest[nearest] - place) < 1e-9 * scene.extent:
                worst = max(worst, np.nanmax(np.abs(last.x[nearest] - place - way)) / scene.extent)
    return float(worst)


def check_frames(scene, frames, row):
    """Counts what is wrong into a row; returns texts."""
    texts = []
    for number, frame in enumerate(frames):
        finite = np.isfinite(frame.x).all()  # else all comparisons would pass
        wrong, crossed, inside = check_validity(frame.x, frame.simplices, scene.obstacles(frame.t)) if finite else ([0], [], [])
        row["inversions"] += len(wrong)
        if not scene.about["contact"]:
            crossed = inside = []
        row["intersections"] += len(crossed) + len(inside)
        kinds = ((wrong, "simplices that are not positive"), (crossed, "intersections"), (inside, "vertices inside"))
        texts += [f"frame {number}: {len(found)} {kind}, first {np.ravel(found[0]).tolist()}" for found, kind in kinds if len(found)]
    return texts


def score(scene_folder, folder):
    """One row of the table."""
    scene = Scene(scene_folder)
    about = json.loads((folder / "result.json").read_text()) if (folder / "result.json").exists() else {}
    row = {"scene": scene_folder.name, "verdict": "", "ended": False, "frames": 0, "intersections": 0, "inversions": 0, "references": "",
           **dict.fromkeys(("setup", "momentum", "energy", "off"), math.nan), "seconds": about.get("seconds", math.nan), "why": ""}
    row |= {name: about.get(name, "") for name in ("iterations", "certificate", "notes", "code", "version", "commit")}
    frames = read_frames(folder, about, scene.dim)
    row["frames"] = len(frames)
    if not frames:
        return row | {"verdict": "no result", "why": "no frames"}
    row["ended"] = bool(frames[-1].t >= scene.about["time"]["end"] * (1 - 1e-9))
    texts = check_frames(scene, frames, row)
    states = [state_of(scene, frame, before) for before, frame in zip([None, *frames], frames)]
    for k, state in enumerate(states):
        state.contact = about["contact_energy"][k] if "contact_energy" in about else 0.0
        state.forces = {name: series[k] for name, series in about.get("forces", {}).items()}
    row["setup"], row["momentum"], row["energy"] = setup_error(scene, frames), momentum_error(scene, states), energy_growth(scene, states)
    bars = [("ended", row["ended"]), ("intersections", row["intersections"] == 0), ("inversions", row["inversions"] == 0),
            ("setup", row["setup"] <= SETUP_BAR), ("momentum", not row["momentum"] > MOMENTUM_BAR),
            ("energy", not row["energy"] > ENERGY_BAR)]
    for reference in scene.about["references"] if row["ended"] else []:
        value = value_of(reference, states)
        if value is None:
            continue
        off = abs(value - reference["value"]) / reference["bar"]
        row["off"] = np.nanmax([row["off"], off])
        row["references"] += ("; " if row["references"] else "") + f"{reference['of']} {value:.6g} for {reference['value']:.6g}"
        bars.append((f"{reference['of']} off by {off:.2g} bars", off <= 1))
    failed = [name for name, passed in bars if not passed]
    verdict = "right" if not failed else "overlaps" if failed == ["intersections"] else "wrong"
    return row | {"verdict": verdict, "why": "; ".join([*failed, *texts[:2]])}


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scenes", type=pathlib.Path)
    parser.add_argument("results", type=pathlib.Path)
    parser.add_argument("--scene", action="append")
    parser.add_argument("--csv", type=pathlib.Path)
    options = parser.parse_args()
    rows = []
    for folder in sorted(options.results.iterdir()):
        is_asked = not options.scene or any(part in folder.name for part in options.scene)
        if not is_asked or not (options.scenes / folder.name / "scene.json").exists():
            continue
        rows.append(score(options.scenes / folder.name, folder))
        print(*(f"{rows[-1][key]:.3g}" if isinstance(rows[-1][key], float) else rows[-1][key]
                for key in ("scene", "verdict", "frames", "momentum", "energy", "off", "seconds", "why")), sep="\t", flush=True)
        if options.csv:
            with open(options.csv, "w", newline="") as file:
                writer = csv.DictWriter(file, rows[0].keys(), lineterminator="\n")
                writer.writeheader()
                writer.writerows({k: f"{v:.6g}" if isinstance(v, float) else v for k, v in row.items()} for row in rows)
    print(f"{sum(row['verdict'] == 'right' for row in rows)} of {len(rows)} right")
    return 0 if all(row["verdict"] == "right" for row in rows) else 1


if __name__ == "__main__":
    sys.exit(main())
