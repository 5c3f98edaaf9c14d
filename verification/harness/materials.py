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


def powers(F, alpha, m):
    """Sum of the principal stretches' powers alpha = 2, 4 or -2."""
    C = F.T * F
    return {2: lambda: m.tr(C), 4: lambda: m.tr(C * C), -2: lambda: m.tr(m.inv(C))}[alpha]()


def isochoric_powers(F, alpha, dim, m):
    """Less their number. Cases have PolyFEM's defaults, by which laws in 2D have two stretches."""
    return powers(F, alpha, m) / m.det(F)**(alpha / dim) - dim


def bulk(F, K, m):
    J = m.det(F)
    return K / 4 * (J**2 - 1 - 2 * m.ln(J))


def yeoh(F, c1, c2, c3, K, dim, m):
    x = isochoric_powers(F, 2, dim, m)
    return c1 * x + c2 * x**2 + c3 * x**3 + bulk(F, K, m)


OGDEN_ALPHAS = [2, 4, -2]


def ogden(F, mu1, mu2, mu3, K, dim, m):
    return sum(mu / alpha * isochoric_powers(F, alpha, dim, m) for mu, alpha in zip((mu1, mu2, mu3), OGDEN_ALPHAS)) + bulk(F, K, m)


def arruda_boyce(F, mu, lambda_m, K, dim, m):
    I = isochoric_powers(F, 2, dim, m) + dim
    series = (1 / 2, 1 / 20, 11 / 1050, 19 / 7000, 519 / 673750)
    return mu * sum(c * (I**i - dim**i) / lambda_m**(2 * i - 2) for i, c in enumerate(series, start=1)) + bulk(F, K, m)


def isochoric_mooney_rivlin(F, c1, c2, K, dim, m):
    return c1 * isochoric_powers(F, 2, dim, m) + c2 * isochoric_powers(F, -2, dim, m) + bulk(F, K, m)


FOAM_ALPHAS = [2, -2]


def hyperfoam(F, mu1, mu2, nu1, nu2, dim, m):
    betas = [nu / (1 - 2 * nu) for nu in (nu1, nu2)]
    return sum(2 * mu / alpha**2 * (powers(F, alpha, m) - dim + (m.det(F)**(-alpha * beta) - 1) / beta)
               for mu, alpha, beta in zip((mu1, mu2), FOAM_ALPHAS, betas))


def unconstrained_ogden(F, mu1, mu2, D1, D2, dim, m):
    change = m.det(F) - 1
    return (sum(2 * mu / alpha**2 * isochoric_powers(F, alpha, dim, m) for mu, alpha in zip((mu1, mu2), FOAM_ALPHAS))
            + change**2 / D1 + change**4 / D2)


FIBRE = [0.6, 0.8, 0]


def neo_hookean_with_fibres(F, mu, lmbda, k1, k2, kappa, dim, m):
    J, C = m.det(F), F.T * F
    squared = sum(FIBRE[i] * FIBRE[j] * C[i, j] for i in range(dim) for j in range(dim))
    x = kappa * isochoric_powers(F, 2, dim, m) + (1 - dim * kappa) * (squared / J**(2 / dim) - 1)
    fibres = k1 / (2 * k2) * (m.exp(k2 * x**2) - 1)
    return neo_hookean(F, mu, lmbda, dim, m) + m.conditional(m.gt(x, 0), fibres, 0)


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


def flat(material, dim):
    """Coefficients of a law of the table in the order of its keys, lists one after the other; exponents are in its formula."""
    values = [value for key, value in material.items() if key not in ("type", "rho", "alphas")]
    return tuple(number for value in values for number in (value if isinstance(value, list) else [value]))


def with_fibres(E, nu, k1, k2, kappa, rho):
    return {"type": "MaterialSum", "rho": rho, "models": [
        {"type": "HGOFiber", "k1": k1, "k2": k2, "kappa": kappa, "fiber_direction": FIBRE},
        {"type": "NeoHookean", "E": E, "nu": nu}]}


def coefficients_with_fibres(material, dim):
    fibre, base = material["models"]
    return (*lame(base["E"], base["nu"], dim), fibre["k1"], fibre["k2"], fibre["kappa"])


# Laws of the table of sums, tested by `matrices`.
SUMS = {
    "Yeoh": Law(yeoh, [{"type": "Yeoh", "C": [3e3, 200.0, 10.0], "K": 5e4, "rho": 900.0},
                       {"type": "Yeoh", "C": [5e5, -2e4, 3e3], "K": 2e6, "rho": 2700.0}], flat),
    "Ogden": Law(ogden, [{"type": "Ogden", "mus": [3e3, 200.0, -500.0], "alphas": OGDEN_ALPHAS, "K": 5e4, "rho": 900.0},
                         {"type": "Ogden", "mus": [5e5, 1e5, -2e5], "alphas": OGDEN_ALPHAS, "K": 2e6, "rho": 2700.0}], flat),
    "Arruda-Boyce": Law(arruda_boyce, [{"type": "ArrudaBoyce", "mu": 5e3, "lambda_m": 2.5, "K": 5e4, "rho": 900.0},
                                       {"type": "ArrudaBoyce", "mu": 8e5, "lambda_m": 4.0, "K": 2e6, "rho": 2700.0}], flat),
    "isochoric Mooney-Rivlin": Law(
        isochoric_mooney_rivlin, [{"type": "IsochoricMooneyRivlin", "c1": 3e3, "c2": 700.0, "K": 2e4, "rho": 900.0},
                                  {"type": "IsochoricMooneyRivlin", "c1": 5e5, "c2": 1e5, "K": 1.5e6, "rho": 2700.0}], flat),
    "hyperfoam": Law(hyperfoam, [{"type": "Hyperfoam", "mus": [3e3, 1e3], "alphas": FOAM_ALPHAS, "nus": [0.1, 0.3], "rho": 90.0},
                                 {"type": "Hyperfoam", "mus": [4e5, 3e5], "alphas": FOAM_ALPHAS, "nus": [0.2, 0.4], "rho": 270.0}],
                     flat),
    "unconstrained Ogden": Law(
        unconstrained_ogden,
        [{"type": "UnconstrainedOgden", "mus": [3e3, 1e3], "alphas": FOAM_ALPHAS, "Ds": [1e-4, 3e-4], "rho": 900.0},
         {"type": "UnconstrainedOgden", "mus": [4e5, 3e5], "alphas": FOAM_ALPHAS, "Ds": [1e-6, 4e-6], "rho": 2700.0}], flat),
    "neo-Hookean with fibres": Law(neo_hookean_with_fibres, [with_fibres(2e4, 0.35, 5e3, 0.7, 0.1, 900.0),
                                                             with_fibres(3e6, 0.2, 1e6, 1.3, 0.0, 2700.0)],
                                   coefficients_with_fibres),
}


def all_laws(dim):
    return laws(dim) | SUMS


def laws(dim):
    """Those that are different laws in this dimension."""
    return {name: law for name, law in LAWS.items() if dim == 2 or "plane strain" not in name}


def words(name):
    """A law's name as part of a file's."""
    return name.replace(", ", "-").replace(" ", "-").replace(".", "")
