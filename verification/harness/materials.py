# SPDX-License-Identifier: MIT
"""Material laws in UFL, from their formulas (scene-format, section 3): what our derivatives are held against."""
import dataclasses

import ufl


def lame(E, nu, dim, plane_strain=False):
    """mu and lambda of a scene's material (scene-format, section 3.2)."""
    return E / (2 * (1 + nu)), nu * E / (1 - nu**2) if dim == 2 and not plane_strain else E * nu / ((1 + nu) * (1 - 2 * nu))


def neo_hookean(F, mu, lmbda, dim):
    J = ufl.det(F)
    return mu / 2 * (ufl.tr(F.T * F) - dim - 2 * ufl.ln(J)) + lmbda / 2 * ufl.ln(J)**2


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


# Every line is tested by `matrices` and `statics`. Plane strain changes nothing in 3D.
LAWS = {
    "neo-Hookean": Law(neo_hookean, elastic("NeoHookean"), lame_of),
    "neo-Hookean, plane strain": Law(neo_hookean, elastic("NeoHookean", plane_strain=True), lame_of),
}


def laws(dim):
    """Those that are different laws in this dimension."""
    return {name: law for name, law in LAWS.items() if dim == 2 or "plane strain" not in name}
