# SPDX-License-Identifier: MIT
"""Material laws from their formulas (docs/theory.md, "Materials"), written with the operators of a module `m`: `ufl`, or the
symbolic one of harness.manufactured. They are what our derivatives are held against."""
import dataclasses


def lame(E, nu, dim, plane_strain=False):
    """mu and lambda of a scene's material (docs/theory.md, "Materials")."""
    return E / (2 * (1 + nu)), nu * E / (1 - nu**2) if dim == 2 and not plane_strain else E * nu / ((1 + nu) * (1 - 2 * nu))


def neo_hookean(F, mu, lmbda, dim, m):
    J = m.det(F)
    return mu / 2 * (m.tr(F.T * F) - dim - 2 * m.ln(J)) + lmbda / 2 * m.ln(J)**2


def linear(F, mu, lmbda, dim, m):
    e = m.sym(F) - m.Identity(dim)
    return mu * m.inner(e, e) + lmbda / 2 * m.tr(e)**2


def saint_venant(F, mu, lmbda, dim, m):
    E = (F.T * F - m.Identity(dim)) / 2
    return mu * m.inner(E, E) + lmbda / 2 * m.tr(E)**2


def trace_of_stretch(F, dim, m):
    """tr U of the polar decomposition F = R U, without it: the largest root of a polynomial of F's invariants."""
    C, J = F.T * F, m.det(F)
    I = m.tr(C)
    if dim == 2:
        return m.sqrt(I + 2 * J)
    II = (I**2 - m.tr(C * C)) / 2
    s = m.sqrt(3 * I)  # from above Newton cannot miss the largest root
    for _ in range(5):
        s = s - ((s**2 - I)**2 - 8 * J * s - 4 * II) / (4 * s * (s**2 - I) - 8 * J)
    return s


def fixed_corotated(F, mu, lmbda, dim, m):
    trace = getattr(m, "trace_of_stretch", trace_of_stretch)
    return mu * (m.tr(F.T * F) - 2 * trace(F, dim, m) + dim) + lmbda / 2 * (m.det(F) - 1)**2


def isochoric_invariants(F, dim, m):
    C, J = F.T * F, m.det(F)
    scaled = C / J**(2 / dim)
    return m.tr(scaled), (m.tr(scaled)**2 - m.tr(scaled * scaled)) / 2


def mooney_rivlin(F, c1, c2, k, dim, m):
    I1, I2 = isochoric_invariants(F, dim, m)
    return c1 * (I1 - dim) + c2 * (I2 - dim * (dim - 1) / 2) + k / 2 * m.ln(m.det(F))**2


def mooney_rivlin_3(F, c1, c2, c3, d1, dim, m):
    I1, I2 = isochoric_invariants(F, dim, m)
    return (c1 * (I1 - dim) + c2 * (I2 - dim * (dim - 1) / 2) + c3 * (I1 - dim) * (I2 - dim)
            + d1 * (m.det(F) - 1)**2)


@dataclasses.dataclass
class Law:
    """A law that the cases test: two materials of it that differ much, as a scene has them and as numbers for `density`."""
    density: object
    scene: list
    parameters: object  # (entry of `scene`, dim) -> parameters of `density`


def lame_of(material, dim):
    return lame(material["E"], material["nu"], dim, material.get("plane_strain", False))


def elastic(name, plane_strain=False):
    soft_and_stiff = [{"E": 2e4, "nu": 0.35, "rho": 900.0}, {"E": 3e6, "nu": 0.2, "rho": 2700.0}]
    return [{"type": name, **({"plane_strain": True} if plane_strain else {}), **m} for m in soft_and_stiff]


def coefficients(*names):
    return lambda material, dim: tuple(material[name] for name in names)


# Every line is tested by `matrices`, `statics` and `orders`. Plane strain changes nothing in 3D.
LAWS = {
    "neo-Hookean": Law(neo_hookean, elastic("NeoHookean"), lame_of),
    "neo-Hookean, plane strain": Law(neo_hookean, elastic("NeoHookean", plane_strain=True), lame_of),
    "linear": Law(linear, elastic("LinearElasticity"), lame_of),
    "St. Venant-Kirchhoff": Law(saint_venant, elastic("SaintVenant"), lame_of),
    "St. Venant-Kirchhoff, plane strain": Law(saint_venant, elastic("SaintVenant", plane_strain=True), lame_of),
    "fixed corotated": Law(fixed_corotated, elastic("FixedCorotational"), lame_of),
    "Mooney-Rivlin": Law(mooney_rivlin, [{"type": "MooneyRivlin", "c1": 3e3, "c2": 700.0, "k": 2e4, "rho": 900.0},
                                         {"type": "MooneyRivlin", "c1": 5e5, "c2": 1e5, "k": 1.5e6, "rho": 2700.0}],
                         coefficients("c1", "c2", "k")),
    "Mooney-Rivlin, 3 terms": Law(
        mooney_rivlin_3, [{"type": "MooneyRivlin3Param", "c1": 3e3, "c2": 700.0, "c3": 200.0, "d1": 1e4, "rho": 900.0},
                          {"type": "MooneyRivlin3Param", "c1": 5e5, "c2": 1e5, "c3": 5e4, "d1": 8e5, "rho": 2700.0}],
        coefficients("c1", "c2", "c3", "d1")),
}


def laws(dim):
    """Those that are different laws in this dimension."""
    return {name: law for name, law in LAWS.items() if dim == 2 or "plane strain" not in name}


def words(name):
    """A law's name as part of a file's."""
    return name.replace(", ", "-").replace(" ", "-").replace(".", "")
