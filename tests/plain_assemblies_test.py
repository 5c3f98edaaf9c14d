# SPDX-License-Identifier: MIT
"""Small assemblies as a user writes them, without keys of method: they end, with the values of closed forms.

python3 tests/plain_assemblies_test.py ITR [NAME...]
"""
import math
import sys
import unittest

import defaults_test
from defaults_test import Case, box, rectangle


def sides(dimension=2, first=1):
    """Ids from `first` on: of the sides at the lowest x, y, then at the highest."""
    axes, near = "xyz"[:dimension], 1e-4
    low = [{"id": first + i, "axis": f"-{axis}", "position": near, "relative": True} for i, axis in enumerate(axes)]
    return low + [{"id": first + dimension + i, "axis": axis, "position": 1 - near, "relative": True}
                  for i, axis in enumerate(axes)]


def roller(side, axis, value=0, dimension=2):
    return {"id": side, "value": [value if i == axis else 0 for i in range(dimension)],
            "dimension": [i == axis for i in range(dimension)]}


def ring(path, inner, outer, rings, sectors):
    radii = [inner + (outer - inner) * i / rings for i in range(rings + 1)]
    angles = [2 * math.pi * k / sectors for k in range(sectors)]
    lines = [f"v {r * math.cos(a)!r} {r * math.sin(a)!r} 0" for r in radii for a in angles]
    for i in range(rings):
        for k in range(sectors):
            a, b = 1 + i * sectors + k, 1 + i * sectors + (k + 1) % sectors
            lines += [f"f {a} {a + sectors} {b + sectors}", f"f {a} {b + sectors} {b}"]
    path.write_text("\n".join(lines) + "\n")


class PlainAssemblies(Case):
    STEEL = {"type": "NeoHookean", "E": 2e11, "nu": 0.3, "rho": 7800}

    def last(self, name, file="points.csv"):
        with open(self.folder / "out" / file) as rows:
            return [row for row in defaults_test.csv.DictReader(rows) if row["name"] == name][-1]

    def certify(self, status=0):
        return self.call("certify", self.folder / "out", status=status)

    def pair(self, size, columns, at=0.0):
        """Two squares beside each other, of ids 1 to 4 and 11 to 14."""
        for name, count in zip("ab", columns):
            rectangle(self.folder / f"{name}.obj", size, size, count, count)
        return [{"mesh": f"{name}.obj", "volume_selection": i + 1, "surface_selection": sides(2, 10 * i + 1),
                 "transformation": {"translation": [at + i * size, at]}} for i, name in enumerate("ab")]

    def crack(self, columns=8):
        """A unit square with a crack along y = 1/2 that reaches no side."""
        ids, lines, cells = {}, [], []

        def vertex(i, j, is_low):
            key = i, j, is_low and 2 * j == columns and 2 <= i <= columns - 2
            if key not in ids:
                ids[key] = len(ids) + 1
                lines.append(f"v {i / columns!r} {j / columns!r} 0")
            return ids[key]

        for j in range(columns):
            for i in range(columns):
                a, b, c, d = (vertex(i + k, j + m, 2 * j < columns) for k, m in ((0, 0), (1, 0), (1, 1), (0, 1)))
                is_even = (7 * i + 3 * j) % 2 == 0
                cells += [f"f {a} {b} {d}", f"f {b} {c} {d}"] if is_even else [f"f {a} {b} {c}", f"f {a} {c} {d}"]
        (self.folder / "crack.obj").write_text("\n".join(lines + cells) + "\n")
        return [{"mesh": "crack.obj", "surface_selection": sides()}]

    def press_crack(self, axis, motion):
        held = [roller(1, 0), roller(2, 1), roller(3 + axis, axis, motion)]
        self.run_scene({"geometry": self.crack(), "materials": self.STEEL, "time": {"dt": 0.5, "tend": 1, "quasistatic": True},
                        "boundary_conditions": {"dirichlet_boundary": held}})

    def test_a_crack_that_nothing_opens_is_certified_without_contact(self):
        for axis in (0, 1):  # along the crack, and across it: its faces are pressed into each other by little
            self.press_crack(axis, "1e-3 * t" if axis == 0 else "-1e-7 * t")
            self.certify()

    def test_a_crack_that_is_pressed_far_into_itself_is_not(self):
        self.press_crack(1, "-0.1 * t")
        self.assertIn("failed", self.certify(status=4))

    def test_points_where_ties_bond_are_of_both_bodies_and_others_are_not(self):
        three = self.pair(1, (2, 3)) + [{"mesh": "a.obj", "volume_selection": 3, "transformation": {"translation": [2, 0]}}]
        scene = {"geometry": three, "materials": self.STEEL, "ties": [{"a": 3, "b": 11}], "time": {"dt": 1, "tend": 1},
                 "output": {"points": [{"name": "bonded", "rest": [1, 0.5]}]}}
        self.run_scene(scene)
        scene["output"]["points"].append({"name": "loose", "rest": [2, 0.5]})
        words = self.call("run", self.write(scene), "-o", self.folder / "no", status=2)
        self.assertIn("/output/points/1/rest: found (2, 0.5) m, where bodies 2 and 3 both are", words)

    def test_rigid_bodies_that_overlap_are_parted_without_loads(self):
        overlap = 0.05
        for name, size, columns in (("a", 1, 2), ("b", 2, 3)):
            rectangle(self.folder / f"{name}.obj", size, size, columns, columns)
        for time in ({"dt": 0.01, "time_steps": 2}, {"dt": 1, "time_steps": 2, "quasistatic": True}):
            self.run_scene({"geometry": [{"mesh": "a.obj", "volume_selection": 1, "rigid": {"mass": 1}},
                                         {"mesh": "b.obj", "volume_selection": 2, "rigid": {"mass": 8},
                                          "transformation": {"translation": [1 - overlap, -0.5]}}],
                            "materials": [], "contact": {"enabled": True, "initial_overlap": "resolve"}, "time": time,
                            "output": {"points": [{"name": "a", "rest": [0.25, 0.5]}, {"name": "b", "rest": [2, 0.5]}]}})
            a, b = self.last("a"), self.last("b")
            self.assertAlmostEqual(float(b["u_x"]) - float(a["u_x"]), overlap, delta=0.1 * overlap)
            for point in (a, b):
                self.assertAlmostEqual(float(point["u_y"]), 0, delta=1e-3 * overlap)
            self.certify()

    def test_rigid_bodies_are_pushed_by_obstacles_without_loads(self):
        rectangle(self.folder / "a.obj", 1, 1, 2, 2)
        wall = {"scale": [1, 1.4], "translation": [1.1, -0.2]}
        words = self.run_scene({
            "geometry": [{"mesh": "a.obj", "volume_selection": 1, "rigid": {}},
                         {"mesh": "a.obj", "is_obstacle": True, "surface_selection": 9, "transformation": wall}],
            "materials": [], "contact": {"enabled": True}, "time": {"dt": 0.1, "tend": 1, "quasistatic": True},
            "boundary_conditions": {"obstacle_displacements": [{"id": 9, "value": ["-0.6 * t", 0]}]},
            "output": {"points": [{"name": "p", "rest": [0.5, 0.5]}]}})
        self.assertAlmostEqual(float(self.last("p")["u_x"]), -0.5, delta=0.01)
        self.assertAlmostEqual(float(self.last("p")["u_y"]), 0, delta=1e-3)
        for word in ("forces may be off", "stand off"):  # of forces that are none
            self.assertNotIn(word, words)
        self.certify()

    def pressed(self, **material):
        """Words about a cube of a side of 1 on rollers, pressed on its other sides by five times its modulus."""
        box(self.folder / "cube.msh", (1, 1, 1), (2, 2, 2))
        scene = {"geometry": {"mesh": "cube.msh", "surface_selection": sides(3)},
                 "materials": {"E": 1e6, "nu": 0.3, "rho": 1000, **material},
                 "boundary_conditions": {"dirichlet_boundary": [roller(i + 1, i, 0, 3) for i in range(3)],
                                         "pressure_boundary": [{"id": i, "value": 5e6} for i in (4, 5, 6)]}}
        return self.call("run", self.write(scene), "-o", self.folder / "out", status=3)

    def test_bodies_that_pressure_crushes_say_so(self):
        for law, name in (("LinearElasticity", "linear elasticity"), ("FixedCorotational", "FixedCorotational")):
            self.assertIn(f"of its volume, which {name} does not resist", self.pressed(type=law))
            self.tearDown()
            self.setUp()

    def test_free_bodies_of_linear_elasticity_under_pressure_are_not_said_to_be_pushed_away(self):
        ring(self.folder / "ring.obj", 1, 2, 3, 40)
        scene = {"geometry": {"mesh": "ring.obj", "surface_selection": [{"id": 7, "center": [0, 0], "radius": 1.01}]},
                 "materials": {"type": "LinearElasticity", "E": 1e6, "nu": 0.3, "rho": 1000},
                 "boundary_conditions": {"pressure_boundary": [{"id": 7, "value": 2e5}]},
                 "time": {"dt": 1, "tend": 1, "quasistatic": True}}
        words = self.call("run", self.write(scene), "-o", self.folder / "out", status=3)
        self.assertIn("pressure turns a body of linear elasticity", words)
        self.assertNotIn("nothing comes in its way", words)

    def test_numbers_may_be_texts_with_units(self):
        rectangle(self.folder / "a.obj", 10, 10, 2, 2)
        scene = {"units": {"length": "mm", "mass": "t", "time": "s"},
                 "geometry": {"mesh": "a.obj", "unit": "cm", "surface_selection": sides()},
                 "materials": {"type": "LinearElasticity", "E": "2 MPa", "nu": 0, "rho": "1 g/cm^3"},
                 "boundary_conditions": {"dirichlet_boundary": [{"id": 1, "value": [0, 0]}, {"id": 3, "value": ["0.1 cm", 0]}]},
                 "output": {"forces": [{"name": "side", "surfaces": 1}]}}
        self.run_scene(scene)
        self.assertAlmostEqual(float(self.last("side", "forces.csv")["reaction_x"]) / (-2 * 0.01 * 100), 1, delta=1e-6)
        scene["materials"]["rho"] = "1 MPa"
        words = self.call("run", self.write(scene), "-o", self.folder / "no", status=2)
        self.assertIn("/materials/rho", words)
        self.assertIn("a unit of kg/m^3", words)

    def test_ties_hold_far_from_the_origin_and_in_flight(self):
        for at, way, dt in ((0, 0, 1e-3), (1e5, 0, 1e-3), (1e5, 0, 1e-6), (0, 1e5, 1e-3)):
            start = {"velocity": [{"id": i, "value": [5, 0]} for i in (1, 2)],
                     "solution": [{"id": i, "value": [way, 0]} for i in (1, 2)]}
            self.run_scene({"geometry": self.pair(0.1, (3, 4), at), "materials": self.STEEL, "ties": [{"a": 3, "b": 11}],
                            "initial_conditions": start, "time": {"dt": dt, "time_steps": 5},
                            "output": {"points": [{"name": "p", "rest": [at + 0.15, at + 0.05]}]}})
            moved = float(self.last("p")["u_x"]) - way
            self.assertAlmostEqual(moved, 25 * dt, delta=1e-6 * 25 * dt + 1e-9 * (at + way > 0))

    def test_stiff_ties_and_points_settle(self):
        stiff, far = {**self.STEEL, "E": 1e12}, 1e4
        scene = {"geometry": self.pair(0.1, (3, 4), far), "materials": stiff, "ties": [{"a": 3, "b": 11}],
                 "couplings": [{"id": 13, "kind": "rigid", "held": ["x", "y", "rz"], "motion": ["0.5 * t", "-0.25 * t"],
                                "turn": "30 * t", "name": "grip"}],
                 "time": {"dt": 0.1, "tend": 1, "quasistatic": True},
                 "output": {"points": [{"name": "far end", "rest": [far, far + 0.05]}]}}
        self.run_scene(scene)
        end, turn = self.last("far end"), math.radians(30)
        self.assertAlmostEqual(float(end["u_x"]), 0.5 + 0.2 * (1 - math.cos(turn)), delta=1e-6)
        self.assertAlmostEqual(float(end["u_y"]), -0.25 - 0.2 * math.sin(turn), delta=1e-6)


if __name__ == "__main__":
    defaults_test.ITR = sys.argv[1]
    unittest.main(argv=[sys.argv[0], *sys.argv[2:]])
