#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""The scorer of verification/hard_contact: planted defects, `itr certify` on random meshes, small runs. Arguments: the command,
the source folder."""
import argparse
import json
import pathlib
import subprocess
import sys
import tempfile
import unittest
from fractions import Fraction

SOURCE = pathlib.Path(sys.argv.pop())
ITR = sys.argv.pop()
try:
    import h5py
    import meshio  # noqa: F401
    import numpy as np
except ImportError as error:
    print(f"skipped: {error}")
    sys.exit(77)
sys.dont_write_bytecode = True
sys.path[:0] = [str(SOURCE / "verification/hard_contact"), str(SOURCE / "verification")]

import run  # noqa: E402, isort: skip
import score  # noqa: E402
import make  # noqa: E402, isort: skip
from harness.scenes import box_mesh  # noqa: E402

NO_OBSTACLE = {dim: (np.empty((0, dim)), np.empty((0, 2), int), np.empty((0, 3), int)) for dim in (2, 3)}


def sign_by_fractions(points):
    exact = [[Fraction(float(value)) for value in point] for point in points]
    rows = [[p - q for p, q in zip(point, exact[0])] for point in exact[1:]]
    if len(rows) == 2:
        value = rows[0][0] * rows[1][1] - rows[0][1] * rows[1][0]
    else:
        a, b, c = rows
        value = sum(a[k] * (b[k - 2] * c[k - 1] - b[k - 1] * c[k - 2]) for k in range(3))
    return (value > 0) - (value < 0)


def two_boxes(dim, gap):
    """A box on another one, `gap` above it."""
    points, cells = box_mesh([2] * dim, [1.0] * dim)
    above = points + np.eye(dim)[1] * (1 + gap) + np.eye(dim)[0] * 0.3
    return np.concatenate([points, above]), np.concatenate([cells, cells + len(points)]), len(points)


def count(x, cells, obstacle):
    return [len(found) for found in score.check_validity(x, cells, obstacle)]


class Signs(unittest.TestCase):
    def test_signs_are_those_of_fractions(self):
        rng = np.random.default_rng(3)
        for dim in (2, 3):
            points = [rng.integers(0, 4, (400, dim)) * 0.1 + rng.integers(0, 2, (400, 1)) * 1e6 for _ in range(dim + 1)]
            points[0][:60] *= 1e-200
            expected = [sign_by_fractions([p[k] for p in points]) for k in range(400)]
            self.assertIn(0, expected)
            self.assertEqual(score.orientation(*points).tolist(), expected)
            self.assertEqual(score.exact_orientation(*points).tolist(), expected)


class Planted(unittest.TestCase):
    def test_boxes_apart_by_one_unit_in_the_last_place_are_valid_and_touching_ones_are_not(self):
        for dim in (2, 3):
            x, cells, first = two_boxes(dim, 0.0)
            bottom = (np.arange(len(x)) >= first) & (x[:, 1] == 1)
            self.assertEqual(count(x, cells, NO_OBSTACLE[dim])[0], 0)
            self.assertGreater(count(x, cells, NO_OBSTACLE[dim])[1], 0)
            x[bottom, 1] = np.nextafter(1.0, 2.0)
            self.assertEqual(count(x, cells, NO_OBSTACLE[dim]), [0, 0, 0])
            x[bottom, 1] = np.nextafter(1.0, 0.0)
            self.assertGreater(count(x, cells, NO_OBSTACLE[dim])[1], 0)

    def test_inverted_and_flat_simplices_are_found(self):
        for dim in (2, 3):
            x, cells = box_mesh([2] * dim, [1.0] * dim)
            middle = np.flatnonzero((x == 0.5).all(axis=1))[0]
            x[middle] = 1.2
            self.assertGreater(len(score.inversions(x, cells)), 0)
            corners = np.eye(dim + 1, dim)
            corners[0] = 0.1
            corners[-1] = corners[:-1].mean(axis=0) if dim == 2 else [0.1, 0.45, 0.45]
            exact = sign_by_fractions(corners)
            self.assertEqual(len(score.inversions(corners, np.arange(dim + 1)[None])), int(exact <= 0))

    def test_a_body_in_a_body_and_points_wires_and_sheets_in_a_body_are_found(self):
        for dim in (2, 3):
            x, cells = box_mesh([2] * dim, [1.0] * dim)
            small = np.concatenate([x, 0.1 * x + 0.55]), np.concatenate([cells, cells + len(x)])
            self.assertEqual(count(*small, NO_OBSTACLE[dim])[:2], [0, 0])
            self.assertGreater(count(*small, NO_OBSTACLE[dim])[2], 0)
            point = np.array([[0.3, 0.41, 0.17][:dim]]), *NO_OBSTACLE[dim][1:]
            self.assertEqual(count(x, cells, point), [0, 0, 1])
            wire = np.array([[-1.0] * dim, [2.0] * dim]), np.array([[0, 1]]), NO_OBSTACLE[dim][2]
            self.assertGreater(count(x, cells, wire)[1], 0)
        sheet = np.array([[0.3, 0.3, -1], [0.3, 0.3, 2], [0.3, 2, 0]]), NO_OBSTACLE[3][1], np.array([[0, 1, 2]])
        self.assertGreater(count(x, cells, sheet)[1], 0)

    def test_folds_are_found(self):
        # Two simplices at a vertex, with an edge of one in an edge (a face) of the other.
        x = np.array([[0.0, 0], [1, 0], [0, 1], [2, 0], [2, -1]])
        self.assertGreater(count(x, np.array([[0, 1, 2], [0, 4, 3]]), NO_OBSTACLE[2])[1], 0)
        x[3, 1] = -1e-9
        self.assertEqual(count(x, np.array([[0, 1, 2], [0, 4, 3]]), NO_OBSTACLE[2]), [0, 0, 0])
        solid = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 0], [2, 1, 0], [1, 1, -1]])
        self.assertGreater(count(solid, np.array([[0, 1, 2, 3], [0, 5, 4, 6]]), NO_OBSTACLE[3])[1], 0)


def write_frame(path, x, cells, body, obstacle):
    points, edges, faces = obstacle
    every = np.concatenate([edges, score.edges_of(faces)]) if len(faces) else edges
    with h5py.File(path, "w") as file:
        file.attrs["t"], file.attrs["step"] = 0.0, np.int64(0)
        data = {"mesh/rest": rest_of_boxes(x.shape), "mesh/simplices": cells, "mesh/body": body, "mesh/surface": score.boundary(cells),
                "fields/x": x, "fields/u": x * 0, "fields/v": x * 0, "obstacles/x": points, "obstacles/edges": every,
                "obstacles/faces": faces}
        for name, values in data.items():
            file[name] = values if values.dtype.kind == "f" else values.astype(np.int64)


def rest_of_boxes(shape):
    """Places at rest where all simplices are positive: those of two boxes far apart."""
    points, _ = box_mesh([2] * shape[1], [1.0] * shape[1])
    return np.concatenate([points, points + 5])[:shape[0]]


def sign_by_shadows(triangle):
    """0 for a flat triangle, with which anything may be said to intersect."""
    return max(abs(sign_by_fractions(triangle[:, axes])) for axes in ([0, 1], [1, 2], [2, 0]))


class AsCertify(unittest.TestCase):
    def random_meshes(self, dim, rng, number):
        """Two boxes moved onto each other by sixteenths, some vertices moved on their own, and an obstacle: many touch exactly."""
        points, cells = box_mesh([2] * dim, [1.0] * dim)
        cells = np.concatenate([cells, cells + len(points)])
        for _ in range(number):
            shift = rng.integers(-20, 21, dim) / 16
            x = np.concatenate([points, points * rng.choice([1.0, 1.0, 0.25]) + shift])
            moved = rng.random(len(x)) < rng.choice([0.0, 0.05, 0.3])
            x[moved] += rng.integers(-4, 5, (moved.sum(), dim)) / 16
            corners = rng.integers(-8, 33, (3, dim)) / 16
            obstacle = (corners, np.array([[0, 1], [1, 2]]), NO_OBSTACLE[2][2]) if dim == 2 else (
                corners, NO_OBSTACLE[3][1], np.array([[0, 1, 2]]))
            yield x, cells, obstacle

    def test_random_meshes_are_judged_as_certify_judges_them(self):
        for dim, number in ((2, 150), (3, 60)):
            rng = np.random.default_rng(dim)
            meshes = list(self.random_meshes(dim, rng, number))
            with tempfile.TemporaryDirectory() as folder:
                frames = pathlib.Path(folder) / "frames"
                frames.mkdir()
                for k, (x, cells, obstacle) in enumerate(meshes):
                    write_frame(frames / f"{k:06}.h5", x, cells, np.repeat([1, 2], len(cells) // 2), obstacle)
                said = subprocess.run([ITR, "certify", folder, "--json"], capture_output=True, text=True).stdout
            certified = {k: [0, 0] for k in range(number)}
            for violation in json.loads(said)["violations"]:
                certified[int(violation["text"][7:13])][violation["of"] != "cells"] += 1
            valid = 0
            for k, (x, cells, obstacle) in enumerate(meshes):
                inverted, crossed, inside = count(x, cells, obstacle)
                self.assertEqual(inverted, certified[k][0], (dim, k))
                self.assertEqual(crossed + inside > 0, certified[k][1] > 0, (dim, k))
                if crossed and not (dim == 3 and any(sign_by_shadows(x[facet]) == 0 for facet in score.boundary(cells))):
                    self.assertEqual(crossed, certified[k][1], (dim, k))
                valid += inverted + crossed + inside == 0
            self.assertTrue(0.05 < valid / number < 0.95, valid)


class Runs(unittest.TestCase):
    def setUp(self):
        self.temporary = tempfile.TemporaryDirectory()
        self.scenes, self.results = (pathlib.Path(self.temporary.name) / name for name in ("scenes", "results"))

    def tearDown(self):
        self.temporary.cleanup()

    def run_scene(self, name):
        make.write(name, self.scenes)
        run.run_all(argparse.Namespace(scenes=self.scenes, results=self.results, scene=None, long=False, limit=60, again=True, itr=ITR))
        return self.score(name)

    def score(self, name):
        return score.score(self.scenes / name, self.results / name)

    def change(self, name, **arrays):
        path = self.results / name / "frames.npz"
        with np.load(path) as file:
            kept = {key: file[key] for key in file.files}
        for key, function in arrays.items():
            kept[key] = function(kept[key].copy())
        np.savez(path, **kept)

    def test_a_run_with_a_closed_form_is_right_and_a_changed_one_is_not(self):
        row = self.run_scene("patch_pressed_2d")
        self.assertEqual(row["verdict"], "right", row)
        self.assertIn("force", row["references"])
        self.change("patch_pressed_2d", x=lambda x: x * [1, 1.02])
        row = self.score("patch_pressed_2d")
        self.assertEqual(row["verdict"], "wrong")
        self.assertIn("intersections", row["why"])

    def test_momentum_and_energy_that_come_from_nowhere_are_found(self):
        def pushed(v):
            v[20:] += 0.01
            return v
        self.assertEqual(self.run_scene("collide_free_2d")["verdict"], "right")
        self.change("collide_free_2d", v=pushed)
        self.assertIn("momentum", self.score("collide_free_2d")["why"])
        with np.load(self.results / "collide_free_2d/frames.npz") as file:
            x = file["x"]
        self.change("collide_free_2d", v=lambda v: v[:1] + 0 * v, x=lambda x: x[:1] + 0 * x)  # stands, though it has a velocity
        self.assertIn("momentum", self.score("collide_free_2d")["why"])
        self.change("collide_free_2d", x=lambda _: x)
        self.change("collide_free_2d", v=lambda v: v * np.linspace(1, 1.2, len(v))[:, None, None])
        self.assertIn("energy", self.score("collide_free_2d")["why"])

    def test_a_run_that_stops_or_whose_mesh_is_another_is_found(self):
        self.run_scene("vertex_on_vertex")
        self.change("vertex_on_vertex", rest=lambda rest: rest * 1.01)
        self.assertIn("setup", self.score("vertex_on_vertex")["why"])
        for name in ("t", "x", "v"):
            self.change("vertex_on_vertex", **{name: lambda values: values[:-1]})
        self.assertIn("ended", self.score("vertex_on_vertex")["why"])

    def test_vtu_files_are_read_like_arrays(self):
        first = self.run_scene("gap_1e_6")
        folder = self.results / "gap_1e_6"
        frames = score.read_npz(folder / "frames.npz")
        (folder / "frames.npz").unlink()
        for k, frame in enumerate(frames):
            flat = lambda values: np.pad(values, ((0, 0), (0, 1)))  # noqa: E731
            meshio.Mesh(flat(frame.rest), [("triangle", frame.simplices)], {"u": flat(frame.x - frame.rest), "v": flat(frame.v)},
                        {"body": [frame.body]}).write(folder / f"{k:04}.vtu")
        about = json.loads((folder / "result.json").read_text())
        (folder / "result.json").write_text(json.dumps(about | {"times": [frame.t for frame in frames]}))
        second = self.score("gap_1e_6")
        self.assertEqual((first["verdict"], first["frames"]), (second["verdict"], second["frames"]))
        self.assertAlmostEqual(first["momentum"], second["momentum"])

    def test_every_scene_is_written_and_valid_at_the_start(self):
        names = list(make.all_scenes())
        self.assertGreater(len(names), 100)
        for name in names[::9]:
            make.write(name, self.scenes)
            scene = score.Scene(self.scenes / name)
            self.assertEqual(count(scene.points, scene.simplices, scene.obstacles(0.0)), [0, 0, 0], name)


if __name__ == "__main__":
    unittest.main()
