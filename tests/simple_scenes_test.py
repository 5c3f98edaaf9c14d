#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""The generator of simple scenes knows right values, and does not let wrong ones pass. Argument: the source folder."""
import json
import math
import pathlib
import sys
import types
import unittest

SOURCE = pathlib.Path(sys.argv.pop())
sys.path.insert(0, str(SOURCE / "verification/stability"))
try:
    import numpy as np
    import reference
    import simple
    import simple_scenes as scenes
except ImportError as missing:
    print(missing)
    sys.exit(77)

STEEL = {"id": 1, "type": "NeoHookean", "E": 2e11, "nu": 0.3, "rho": 7800.0}


def block(dim, order, material=STEEL):
    points, cells = scenes.box_mesh([2, 3, 2][:dim], [0.3, 0.5, 0.2][:dim], jitter=0.2)
    return reference.Solid(points, cells, np.ones(len(cells), dtype=int), {1: material}, order)


def on(solid, axis, at):
    return np.flatnonzero(np.abs(solid.facet_center[:, axis] - at) < 1e-9)


EVERY_ELEMENT = [(dim, order) for dim in (2, 3) for order in (1, 2)]


class Reference(unittest.TestCase):
    def test_mass_loads_and_rigid_motions(self):
        for dim, order in EVERY_ELEMENT:
            solid, volume = block(dim, order), 0.15 if dim == 2 else 0.03
            self.assertAlmostEqual(solid.mass() / (7800 * volume), 1, 12)
            closed = solid.traction(range(len(solid.facets)), 1.0)
            self.assertTrue(np.allclose(closed.sum(axis=0), 0, atol=1e-12), "pressure all round")
            self.assertAlmostEqual(solid.traction(on(solid, 0, 0.3), 1.0)[:, 0].sum() / -(0.5 if dim == 2 else 0.1), 1, 12)
            zero = np.zeros(solid.nodes.shape)
            motion = reference.Motion(solid, zero > 0, lambda t: zero, lambda t: zero)
            self.assertEqual(motion.rigid_modes(), 3 if dim == 2 else 6)

    def test_a_bar_is_pulled(self):
        """By its modulus and Poisson's ratio, for each element and each way to give moduli."""
        for dim, order in EVERY_ELEMENT:
            solid = block(dim, order)
            held = np.abs(solid.nodes) < 1e-9
            load = solid.traction(on(solid, 1, 0.5), np.eye(dim)[1] * 1e6)
            u, reaction = reference.Motion(solid, held, lambda t: 0 * solid.nodes, lambda t: load).static()
            self.assertTrue(np.allclose(u[:, 1], 1e6 / 2e11 * solid.nodes[:, 1], rtol=1e-9, atol=1e-16))
            self.assertTrue(np.allclose(u[:, 0], -0.3e6 / 2e11 * solid.nodes[:, 0], rtol=1e-9, atol=1e-16))
            self.assertAlmostEqual(reaction[:, 1].sum() / -load[:, 1].sum(), 1, 9)

    def test_plane_strain_and_mooney_rivlin(self):
        self.assertEqual(reference.small_strain_moduli(STEEL | {"plane_strain": True}, 2), reference.small_strain_moduli(STEEL, 3))
        mu, lam = reference.small_strain_moduli({"type": "MooneyRivlin", "c1": 3.0, "c2": 1.0, "k": 20.0}, 3)
        self.assertEqual((mu, lam + 2 / 3 * mu), (8.0, 20.0))

    def test_integrators(self):
        """Fall from rest by each one's own sum, and the decay of one mode over a step."""
        solid, h, n = block(2, 1), 0.1, 5
        free = np.zeros(solid.nodes.shape, dtype=bool)
        weight = solid.weight([0, -9.81])
        motion = reference.Motion(solid, free, lambda t: 0 * solid.nodes, lambda t: weight)
        falls = {"ImplicitEuler": n * (n + 1) / 2, "ImplicitNewmark": (n - 0.5)**2 / 2 + 1 / 8}
        for integrator, steps in falls.items():
            *_, (_, u, v, _) = motion.run(integrator, h, n, 0 * solid.nodes, 0 * solid.nodes)
            self.assertTrue(np.allclose(u[:, 1], -9.81 * h**2 * steps, rtol=1e-9), integrator)
        motion = reference.Motion(solid, free, lambda t: 0 * solid.nodes, lambda t: 0 * solid.nodes)
        shape = motion.modes[:, -1].reshape(solid.nodes.shape)
        h = 0.1 / motion.fastest()
        for integrator, after in {"ImplicitEuler": 1 / 1.01, "ImplicitNewmark": None}.items():
            states = list(motion.run(integrator, h, 400, shape, 0 * shape))
            if after:
                self.assertAlmostEqual(states[1][1].ravel() @ shape.ravel() / (shape**2).sum(), after, 9)
            size = max(np.abs(u).max() for _, u, _, _ in states[-70:]) / np.abs(shape).max()  # a period
            low, high = (1.01**-200, 1.01**-165) if after else (0.99, 1.001)
            self.assertTrue(low <= size <= high, (integrator, size))

    def test_euler_load(self):
        """Of a clamped column of quadratic elements, plane strain with nu = 0."""
        material = STEEL | {"nu": 0.0, "plane_strain": True}
        points, cells = scenes.crossed_mesh([1, 10], [0.04, 1.0])
        solid = reference.Solid(points, cells, np.ones(len(cells), dtype=int), {1: material}, 2)
        held = np.repeat((np.abs(solid.nodes[:, 1:] - 0.5) > 0.5 - 1e-9), 2, axis=1)
        top = (solid.nodes[:, 1:] > 0.5) * np.array([0, -1.0])
        motion = reference.Motion(solid, held, lambda t: top, lambda t: 0 * top)
        u, reaction = motion.static()
        inner = np.ix_(motion.free, motion.free)
        critical = 1 / scenes.scipy.linalg.eigh(-solid.stress_stiffness(u)[inner], solid.K[inner], eigvals_only=True).max()
        load = critical * np.abs(reaction[solid.nodes[:, 1] > 1 - 1e-9, 1].sum())
        self.assertAlmostEqual(load / (4 * math.pi**2 * 2e11 * 0.04**3 / 12), 1, delta=0.03)


class Judgement(unittest.TestCase):
    """Of outcomes that are made up, for scenes whose right values are known."""

    def scene(self, mode):
        for number in range(1000):
            scene = scenes.draw_scene(1, number, "load")
            if scene.facts["mode"] == mode and scene.facts["strain"] > 1e-6:
                return scene
        return self.fail(mode)

    def outcome(self, scene, change=lambda frame: None):
        solid, states, plan = (scene.check.__closure__[k].cell_contents
                               for k in map(scene.check.__code__.co_freevars.index, ("solid", "states", "self")))
        frames = []
        for step, (t, u, v, reaction) in enumerate(states):
            frame = types.SimpleNamespace(t=t, step=step, rest=solid.nodes, u=u.copy(), v=v.copy(), reaction=reaction.copy(),
                                          momentum=(solid.scalar_mass @ v).sum(axis=0), kinetic=0.0)
            if step:
                change(frame)
            frames.append(frame)
        return types.SimpleNamespace(frames=frames, steps=[], forces={})

    def verdict(self, scene, change=lambda frame: None, words=""):
        return simple.judge(scene, self.outcome(scene, change), 0, words)[0]

    def test_what_is_off_is_wrong(self):
        def scaled(name, factor):
            return lambda frame: setattr(frame, name, factor * getattr(frame, name))
        quantities = {"static": ("u", "reaction"), "quasistatic": ("u", "reaction"), "dynamic": ("u", "v", "reaction", "momentum")}
        for mode, names in quantities.items():
            scene = self.scene(mode)
            self.assertEqual(self.verdict(scene), "right")
            for name in names:
                for factor in (0.0, 1.05, math.nan):
                    self.assertEqual(self.verdict(scene, scaled(name, factor)), "wrong without a word", (mode, name, factor))
                self.assertEqual(self.verdict(scene, scaled(name, 1.001)), "right", (mode, name))

    def test_a_warning_counts_if_it_speaks_of_the_run(self):
        scene = self.scene("static")
        off = lambda frame: frame.u.__imul__(2)
        self.assertEqual(self.verdict(scene, off, "warning: step 1: motion is below the round-off of positions"), "said")
        for advice in ("warning: body 1: thin, with about 1 linear elements through it", "warning: the bodies span 900 m"):
            self.assertEqual(self.verdict(scene, off, advice), "wrong without a word")

    def test_ends(self):
        scene = self.scene("static")
        for status, may_refuse, verdict in ((3, False, "stopped"), (3, True, "said"), (2, True, "said"), (-11, True, "stopped"),
                                            (None, True, "stopped")):
            scene.may_refuse = may_refuse
            self.assertEqual(simple.judge(scene, None, status, "itr: stopped in step 1: no reason")[0], verdict)

    def test_bar(self):
        rows = lambda *counts: [simple.Row(0, "load", verdict) for verdict, n in zip(simple.VERDICTS, counts) for _ in range(n)]
        self.assertTrue(simple.passed(rows(95, 5, 0, 0)))
        self.assertFalse(simple.passed(rows(94, 6, 0, 0)))
        self.assertFalse(simple.passed(rows(99, 0, 1, 0)))
        self.assertFalse(simple.passed(rows(99, 0, 0, 1)))


class Drawing(unittest.TestCase):
    def test_a_number_gives_the_same_scene_again(self):
        self.assertEqual(set(scenes.DECK), set(scenes.KINDS))
        for number, kind in enumerate(scenes.KINDS):
            first, again, other = (json.dumps(scenes.draw_scene(seed, number, kind).content) for seed in (5, 5, 6))
            self.assertEqual(first, again, kind)
            self.assertNotEqual(first, other, kind)


if __name__ == "__main__":
    unittest.main()
