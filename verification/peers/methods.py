# SPDX-License-Identifier: MIT
"""By which settings each code solves each problem: the best of a few that were tried (README.md names the others)."""
import dataclasses

import problems

ELEMENTS = {1: "linear", 2: "quadratic"}
ONE, TWO = "\n1, 1", "\n0.5, 1"  # increments of CalculiX: the first, and the end
TOUCHING = {"/contact/initial_overlap": "resolve"}


@dataclasses.dataclass
class Method:
    code: str
    order: int
    levels: int
    settings: dict

    def at(self, level):
        return self.settings

    def words(self):
        """The settings as the table shows them."""
        shown = {**self.settings, **self.settings.get("keys", {})}
        shown.pop("keys", None)
        shown.pop("nudge", None)
        return "; ".join(f"{name} {' '.join(str(value).split())}" for name, value in shown.items()) or "defaults"


def methods(itr, calculix, getfem=None, linear=3, quadratic=2):
    """All codes with linear and quadratic elements."""
    found = []
    for order, levels in ((1, linear), (2, quadratic)):
        for code, settings in (("ITR", itr), ("CalculiX", calculix), ("GetFEM", getfem)):
            if settings is not None and levels:
                found.append(Method(code, order, levels, settings))
    return found


CASES = {
    "sphere": methods({}, {"stiffness": 1e3, "increments": ONE}, {"steps": 1}, linear=3, quadratic=1),
    "sphere_section": methods({}, {"stiffness": 1e4, "increments": TWO}, {"steps": 1}, quadratic=2),
    "ring": methods({"dt": 0.5}, {"stiffness": 100.0, "increments": TWO}, {"steps": 2}, quadratic=2),
    "ironing": [Method("ITR", 1, 1, {"dt": 0.05})],
    "punch": methods({"keys": TOUCHING}, {"stiffness": 1e6, "increments": ONE}),
    "hertz": methods({"keys": TOUCHING}, {"stiffness": 1e6, "increments": TWO},
                     {"steps": 1, "release": 4.0, "nudge": {1: [0.0, -0.1]}, "augmentation": 1.0}, linear=2, quadratic=1),
    "press_fit": [Method("ITR", 1, 3, {"keys": {**TOUCHING, "/contact/dhat": 1e-6}}), Method("ITR", 2, 3, {"keys": TOUCHING}),
                  *methods(None, {"stiffness": 1e8, "increments": ONE}, {"steps": 1, "release": 1.0}, quadratic=3)],
    "snap_hook": [Method("ITR", 2, 2, {}), Method("CalculiX", 2, 2, {"stiffness": 1e5, "increments": 100})],
    "block": methods({}, {"stiffness": 1e4, "increments": ONE}, {"steps": 1}, quadratic=1),
}

FINE = {"steps": 1}
REFERENCES = {  # case -> a value or words on the source, who computes it, and the finest levels
    "sphere_section": ("GetFEM, quadratic, section", Method("GetFEM", 2, 0, FINE), (3, 4)),
    "ring": ("GetFEM, quadratic", Method("GetFEM", 2, 0, {"steps": 20}), (2, 3)),
    "punch": ("ITR, quadratic, d-hat 0.001 mm",
              Method("ITR", 2, 0, {"keys": {**TOUCHING, "/contact/dhat": 1e-3}}), (1, 2)),
    "hertz": ("GetFEM, quadratic", Method("GetFEM", 2, 0, {"steps": 2, "release": 4.0, "nudge": {1: [0.0, -0.1]}, "augmentation": 1.0}),
              (0, 1)),
    "press_fit": (problems.lame_rim(), None, ()),
    "block": ("GetFEM, quadratic, a quarter, limit of three levels", Method("GetFEM", 2, 0, FINE), (0, 1, 2)),
}

KNOWN = {  # case -> what its value is worth, and its source
    "press_fit": (0.0, "closed form (Lamé)"),
}
FINER_PROBLEM = {"block": "block_quarter"}  # what its reference is computed on
SAME_REFERENCE = {"sphere": "sphere_section"}  # whose problem is the same

WHY = {  # case -> why ITR is not first
    "sphere": "on the same mesh it takes 1 to 1.9 times CalculiX's time, and its value is higher: CalculiX's penalty of 1e3 takes off about "
              "1 % (4.618 with 1e4 on level 0), GetFEM's contact in the mean more, which cancels a part of the mesh's error",
    "hertz": "friction is solved in rounds: 98 iterations, where GetFEM's Newton method has the cone of Coulomb in it and takes 5 to 9; "
             "without friction ITR takes 14 iterations and 0.08 s",
    "press_fit": "one step of hundredths of a second: CalculiX's penalty needs 2 iterations, ITR begins with an equilibrium of the overlap",
    "block": "12 iterations of a barrier against 3 of a penalty; with quadratic elements ITR is far behind, since collision detection "
             "between curved surfaces takes two thirds of its time",
}
