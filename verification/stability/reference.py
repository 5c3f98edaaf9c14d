# SPDX-License-Identifier: MIT
"""Small-strain elasticity on a mesh, assembled and solved without the library: what simple scenes are held against.

Displacements are found by modes of the stiffness over the mass. Each mode is a number that follows the integrator's recursion,
so that a stiff body with a tiny step and a soft one with a long step are both solved to round-off."""
import functools
import itertools
import math

import numpy as np
import scipy.linalg

EDGES = {2: [(0, 1), (1, 2), (0, 2)], 3: [(0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3)]}
ALMOST_RIGID = 1e-11  # eigenvalue over the largest one, below which a mode is a rigid motion
BDF = {1: ([1], 1, 1), 2: ([4, -1], 2, 3), 3: ([18, -9, 2], 6, 11)}  # weights of past states, weight of the rate, divisor


def small_strain_moduli(material, dim):
    """mu and lambda of a scene's material at rest (docs/theory.md, "Materials")."""
    if material["type"] in ("MooneyRivlin", "MooneyRivlin3Param"):
        # The second isochoric invariant is 1 in 2D, so that its product with the first one acts like the first.
        mu = 2 * (material["c1"] + (material["c2"] if dim == 3 else -material.get("c3", 0.0)))
        bulk = material["k"] if material["type"] == "MooneyRivlin" else 2 * material["d1"]
        return mu, bulk - 2 * mu / dim
    E, nu = material["E"], material["nu"]
    plane_stress = dim == 2 and not material.get("plane_strain", False)
    return E / (2 * (1 + nu)), nu * E / (1 - nu**2) if plane_stress else E * nu / ((1 + nu) * (1 - 2 * nu))


@functools.cache
def quadrature(dim):
    """Points in barycentric coordinates and weights that add up to 1; exact for degree 5."""
    at, weight = np.polynomial.legendre.leggauss(4)
    at, weight = (at + 1) / 2, weight / 2
    points, weights = [], []
    for index in itertools.product(range(4), repeat=dim):
        left, w, point = 1.0, math.factorial(dim), []
        for k, i in enumerate(index):  # collapsed coordinates
            point.append(left * at[i])
            w *= weight[i] * (1 - at[i])**(dim - 1 - k)
            left -= point[-1]
        points.append([left, *point])
        weights.append(w)
    return np.array(points), np.array(weights)


def shapes(dim, order, at):
    """Values (points x nodes) and derivatives by barycentric coordinates (points x nodes x dim + 1)."""
    corners = dim + 1
    if order == 1:
        return at, np.broadcast_to(np.eye(corners), (len(at), corners, corners))
    values = [at[:, i] * (2 * at[:, i] - 1) for i in range(corners)] + [4 * at[:, i] * at[:, j] for i, j in EDGES[dim]]
    slopes = np.zeros((len(at), len(values), corners))
    for i in range(corners):
        slopes[:, i, i] = 4 * at[:, i] - 1
    for k, (i, j) in enumerate(EDGES[dim]):
        slopes[:, corners + k, i], slopes[:, corners + k, j] = 4 * at[:, j], 4 * at[:, i]
    return np.stack(values, axis=1), slopes


def nodes_of(points, cells, order):
    """Rest positions of nodes, cells by nodes, and curved edges by vertices, numbered as frames number them."""
    if order == 1:
        return points, cells, np.empty((0, 2), dtype=int)
    pairs = np.sort(np.concatenate([cells[:, list(edge)] for edge in EDGES[points.shape[1]]]), axis=1)
    edges, of_cell = np.unique(pairs, axis=0, return_inverse=True)
    middles = len(points) + of_cell.reshape(-1, len(cells)).T
    return np.concatenate([points, points[edges].mean(axis=1)]), np.column_stack([cells, middles]), edges


class Solid:
    """Nodes, mass and stiffness of a mesh. `materials` are by cell tag; `tags` is a tag for each cell."""

    def __init__(self, points, cells, tags, materials, order=1):
        self.dim, self.order, self.points, self.cells = points.shape[1], order, points, cells
        self.nodes, self.elements, self.edges = nodes_of(points, cells, order)
        self.density = np.array([materials[t]["rho"] for t in tags])
        moduli = np.array([small_strain_moduli(materials[t], self.dim) for t in tags])
        self.mu, self.lam = moduli[:, 0], moduli[:, 1]
        corner = points[cells]
        spread = corner[:, 1:] - corner[:, :1]
        self.volumes = np.linalg.det(spread) / math.factorial(self.dim)
        inverse = np.linalg.inv(spread)
        self.barycentric = np.concatenate([-inverse.sum(axis=2)[:, :, None], inverse], axis=2)  # cells x dim x corners
        self.assemble()
        self.find_facets()

    def assemble(self):
        dim, count = self.dim, len(self.nodes)
        at, weights = quadrature(dim)
        values, slopes = shapes(dim, self.order, at)
        self.gradients = np.einsum("cdk,qnk->cqnd", self.barycentric, slopes)
        scalar = np.einsum("q,qn,qm->nm", weights, values, values)
        mass = np.zeros((count, count))
        stiffness = np.zeros((count, dim, count, dim))
        for c, element in enumerate(self.elements):
            g = self.gradients[c]
            mass[np.ix_(element, element)] += self.density[c] * self.volumes[c] * scalar
            dot = np.einsum("q,qnd,qmd->nm", weights, g, g)
            outer = np.einsum("q,qni,qmj->nimj", weights, g, g)
            local = self.lam[c] * outer + self.mu[c] * np.einsum("q,qnj,qmi->nimj", weights, g, g)
            for i in range(dim):
                local[:, i, :, i] += self.mu[c] * dot
            stiffness[np.ix_(element, range(dim), element, range(dim))] += self.volumes[c] * local
        self.scalar_mass = mass
        self.M = np.kron(mass, np.eye(dim))
        self.K = stiffness.reshape(count * dim, count * dim)

    def find_facets(self):
        """Boundary facets: nodes, barycentres, outward normals, areas."""
        dim, found = self.dim, {}
        for c, cell in enumerate(self.cells):
            for k in range(dim + 1):
                facet = np.delete(cell, k)
                found.setdefault(tuple(sorted(facet)), []).append((c, k))
        self.facets = [(c, k) for owners in found.values() if len(owners) == 1 for c, k in owners]
        self.facet_center = np.array([self.points[np.delete(self.cells[c], k)].mean(axis=0) for c, k in self.facets])
        # The gradient of a barycentric coordinate points inward and is one over the height.
        inward = np.array([self.barycentric[c][:, k] for c, k in self.facets])
        steep = np.linalg.norm(inward, axis=1)
        self.facet_normal = -inward / steep[:, None]
        self.facet_area = np.array([dim * self.volumes[c] for c, _ in self.facets]) * steep

    def facet_nodes(self, f):
        """Vertices of a facet, then the nodes of its edges."""
        c, k = self.facets[f]
        corners = [i for i in range(self.dim + 1) if i != k]
        middle = [self.dim + 1 + i for i, edge in enumerate(EDGES[self.dim]) if k not in edge] if self.order == 2 else []
        return self.elements[c][corners], self.elements[c][middle]

    def nodes_on(self, facets):
        return np.array(sorted({int(n) for f in facets for part in self.facet_nodes(f) for n in part}), dtype=int)

    def traction(self, facets, value):
        """Nodal forces of a traction by rest area: a vector, or a number that acts along the inward normal (a pressure)."""
        force = np.zeros((len(self.nodes), self.dim))
        corner_share = {(2, 1): 1 / 2, (3, 1): 1 / 3, (2, 2): 1 / 6, (3, 2): 0.0}[self.dim, self.order]
        middle_share = {2: 2 / 3, 3: 1 / 3}[self.dim]
        for f in facets:
            t = -value * self.facet_normal[f] if np.isscalar(value) else np.asarray(value)
            corners, middles = self.facet_nodes(f)
            force[corners] += corner_share * self.facet_area[f] * t
            force[middles] += middle_share * self.facet_area[f] * t
        return force

    def weight(self, acceleration):
        return np.outer(self.scalar_mass.sum(axis=1), acceleration)

    def mass(self):
        return float(self.scalar_mass.sum())

    def largest_gradient(self, u):
        """Of a displacement, over all cells and points of quadrature."""
        return float(np.abs(np.einsum("cni,cqnj->cqij", u[self.elements], self.gradients)).max())

    def stress_stiffness(self, u):
        """Geometric stiffness of the small-strain stress of a displacement."""
        dim, count = self.dim, len(self.nodes)
        _, weights = quadrature(dim)
        found = np.zeros((count, count))
        for c, element in enumerate(self.elements):
            g = self.gradients[c]
            slope = np.einsum("ni,qnj->qij", u[element], g)
            strain = (slope + slope.transpose(0, 2, 1)) / 2
            stress = 2 * self.mu[c] * strain + self.lam[c] * np.trace(strain, axis1=1, axis2=2)[:, None, None] * np.eye(dim)
            found[np.ix_(element, element)] += self.volumes[c] * np.einsum("q,qni,qij,qmj->nm", weights, g, stress, g)
        return np.kron(found, np.eye(dim))


class Motion:
    """A solid with held unknowns that follows an integrator. `held` is a boolean (nodes x dim); `target(t)` gives displacements
    (nodes x dim), of which the held ones count; `force(t)` gives nodal forces (nodes x dim)."""

    def __init__(self, solid, held, target, force):
        self.solid, self.target, self.force = solid, target, force
        self.held, self.free = np.flatnonzero(held.ravel()), np.flatnonzero(~held.ravel())
        self.K, self.M = solid.K, solid.M
        if len(self.free):
            block = np.ix_(self.free, self.free)
            rates, self.modes = scipy.linalg.eigh(self.K[block], self.M[block])
            rates[rates < ALMOST_RIGID * rates.max()] = 0
            self.rates = rates

    def rigid_modes(self):
        return int((self.rates == 0).sum()) if len(self.free) else 0

    def fastest(self):
        """Largest angular frequency [rad/s]."""
        return math.sqrt(self.rates.max()) if len(self.free) else 0.0

    def slowest(self):
        elastic = self.rates[self.rates > 0] if len(self.free) else np.zeros(0)
        return math.sqrt(elastic.min()) if len(elastic) else 0.0

    def solve(self, scaling, with_inertia, predicted, t):
        """Displacement (flat) at the end of a step; rigid modes that nothing resists do not move."""
        force = scaling * self.force(t).ravel()
        u = np.zeros_like(force)
        u[self.held] = self.target(t).ravel()[self.held]
        if not len(self.free):
            return u
        right = force[self.free] - scaling * (self.K[np.ix_(self.free, self.held)] @ u[self.held])
        if with_inertia:
            right += (self.M @ predicted)[self.free] - self.M[np.ix_(self.free, self.held)] @ u[self.held]
        weights = self.modes.T @ right
        divisor = scaling * self.rates + (1 if with_inertia else 0)
        amplitudes = np.divide(weights, divisor, out=np.zeros_like(weights), where=divisor > 0)
        u[self.free] = self.modes @ amplitudes
        return u

    def reaction(self, u, acceleration, t):
        """Forces of what holds (nodes x dim)."""
        force = (self.K @ u + self.M @ acceleration).reshape(self.solid.nodes.shape) - self.force(t)
        out = np.zeros(force.size)
        out[self.held] = force.ravel()[self.held]
        return out.reshape(force.shape)

    def static(self, t=1.0):
        u = self.solve(1.0, False, None, t)
        return u.reshape(self.solid.nodes.shape), self.reaction(u, 0 * u, t)

    def run(self, integrator, dt, steps, u0, v0, t0=0.0):
        """Yields t, u, v and reactions (nodes x dim each) of all steps, the start first."""
        shape = self.solid.nodes.shape
        past_u, past_v, a = [np.ravel(u0).copy()], [np.ravel(v0).copy()], np.zeros(np.size(u0))
        yield t0, past_u[0].reshape(shape), past_v[0].reshape(shape), np.zeros(shape)
        for n in range(1, steps + 1):
            t = t0 + n * dt
            if integrator == "ImplicitNewmark":
                predicted = past_u[0] + dt * past_v[0] + dt**2 / 4 * a
                u = self.solve(dt**2 / 4, True, predicted, t)
                v = 2 / dt * (u - past_u[0]) - past_v[0]
                a = 2 / dt * (v - past_v[0]) - a
                past_u, past_v = [u], [v]
                step_a = a
            else:
                wanted = {"ImplicitEuler": 1, "BDF1": 1, "BDF2": 2, "BDF3": 3}[integrator]
                weights, rate, divisor = BDF[min(wanted, len(past_u))]
                b = rate / divisor * dt
                sum_u = sum(w / divisor * p for w, p in zip(weights, past_u))
                sum_v = sum(w / divisor * p for w, p in zip(weights, past_v))
                u = self.solve(b**2, True, sum_u + b * sum_v, t)
                v = (u - sum_u) / b
                step_a = (v - sum_v) / b
                past_u, past_v = [u, *past_u][:wanted], [v, *past_v][:wanted]
            yield t, u.reshape(shape), v.reshape(shape), self.reaction(u, self.acceleration(u, step_a, t), t)

    def acceleration(self, u, by_differences, t):
        """That of free dofs by the forces: differences of positions are round-off where steps are short."""
        a, free, held = by_differences.copy(), self.free, self.held
        if len(free):
            right = (self.force(t).ravel() - self.K @ u)[free] - self.M[np.ix_(free, held)] @ a[held]
            a[free] = self.modes @ (self.modes.T @ right)
        return a

    def quasistatic(self, dt, steps, t0=0.0):
        shape = self.solid.nodes.shape
        yield t0, np.zeros(shape), np.zeros(shape), np.zeros(shape)
        for n in range(1, steps + 1):
            u, reaction = self.static(t0 + n * dt)
            yield t0 + n * dt, u, np.zeros(shape), reaction
