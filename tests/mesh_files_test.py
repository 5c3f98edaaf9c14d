#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Mesh files of other programs: what the faults folder holds, what Debian's Gmsh and meshio write, the section "From STEP" of
docs/user-guide.md, and the commands that messages advise. Parts whose program is not there are left out.

usage: mesh_files_test.py ITR SOURCE_DIR [SHARED_DIR]
"""

import json
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import unittest

import h5py
import numpy as np

ITR, SOURCE = pathlib.Path(sys.argv.pop(1)).resolve(), pathlib.Path(sys.argv.pop(1)).resolve()
SHARED = pathlib.Path(sys.argv.pop(1)) if len(sys.argv) > 1 and not sys.argv[1].startswith("-") else pathlib.Path("/none")
FAULTS = SHARED / "faults" / "meshes"
MATERIAL = {"type": "NeoHookean", "E": 1e6, "nu": 0.3, "rho": 1000}


def run(folder, scene, *options):
    """Runs a scene into folder/out; the messages, and the last frame."""
    path = folder / "scene.json"
    if scene is not None:
        path.write_text(json.dumps(scene))
    out = folder / "out"
    done = subprocess.run([ITR, "run", path, "-o", out, "--overwrite", "--threads", "1", *options], capture_output=True, text=True)
    frames = sorted((out / "frames").glob("*.h5"))
    return done, frames[-1] if frames and done.returncode == 0 else None


def hexahedra(path, order):
    """Two cubes side by side as a deck of Abaqus, with an ELSET for each, and a NSET at either end."""
    points, cells = {}, []
    kind = {1: "C3D8", 2: "C3D20R"}[order]

    def node(x, y, z):
        return points.setdefault((x, y, z), len(points) + 1)

    for x in (0, 2):
        corners = [(x, 0, 0), (x + 2, 0, 0), (x + 2, 2, 0), (x, 2, 0), (x, 0, 2), (x + 2, 0, 2), (x + 2, 2, 2), (x, 2, 2)]
        edges = [(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)]
        middles = [tuple((np.array(corners[a]) + corners[b]) // 2) for a, b in edges] if order == 2 else []
        cells.append([node(*map(int, p)) for p in corners + middles])
    lines = ["*NODE", *(f"{n}, {x}., {y}., {z}." for (x, y, z), n in points.items())]
    for i, cell in enumerate(cells):
        text = ", ".join(map(str, [i + 1, *cell[:14]])) + "".join(f",\n{', '.join(map(str, cell[14:]))}" if cell[14:] else "")
        lines += [f"*ELEMENT, TYPE={kind}, ELSET={'AB'[i]}", text]
    for name, place in (("left", 0), ("right", 4)):
        lines += [f"*NSET, NSET={name}", ",\n".join(str(n) for (x, _, _), n in points.items() if x == place)]
    path.write_text("\n".join(lines) + "\n")


class MeshFiles(unittest.TestCase):
    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp())
        self.addCleanup(shutil.rmtree, self.folder)

    def need(self, program):
        if not shutil.which(program):
            self.skipTest(f"no {program}")

    def gmsh(self, *arguments):
        subprocess.run(["gmsh", *arguments], cwd=self.folder, check=True, capture_output=True)

    def test_faults(self):
        if not FAULTS.exists():
            self.skipTest(f"no {FAULTS}")
        expected = {
            "id_v41a_msh.json": "",
            "neg.json": "48 of 48 elements list their corners the other way round: turned",
            "part.json": "",
            "sides31.json": "",
            "v22par_msh.json": "",
            "v22twice_msh.json": "",
        }
        self.assertEqual(sorted(path.name for path in FAULTS.glob("*.json")), sorted(expected))
        for name, word in expected.items():
            with self.subTest(name):
                scene = json.loads((FAULTS / name).read_text())
                scene["geometry"][0]["mesh"] = str(FAULTS / scene["geometry"][0]["mesh"])
                done, _ = run(self.folder, scene)
                self.assertEqual(done.returncode, 0, done.stderr)
                self.assertIn(word, done.stderr)

    def test_faults_by_name(self):
        if not FAULTS.exists():
            self.skipTest(f"no {FAULTS}")
        for name, changes in {
            "id_v41a_msh.json": {11: "foot", 12: "head", 1: "lower", 2: "upper"},
            "sides31.json": {31: "side_a"},
            "part.json": {5: "end", 1: "plate", 2: "pin"},
        }.items():
            with self.subTest(name):
                scene = json.loads((FAULTS / name).read_text())
                scene["geometry"][0]["mesh"] = str(FAULTS / scene["geometry"][0]["mesh"])
                done, frame = run(self.folder, scene)
                with h5py.File(frame) as stored:
                    by_number = stored["fields/x"][()]
                    if name.startswith("id"):  # a name is kept that the scene calls by its number
                        self.assertEqual({*stored["sets/cells"], *stored["sets/facets"]}, set(changes.values()))
                scene["geometry"][0].pop("surface_selection", None)
                for entry in [*scene["materials"]] if isinstance(scene["materials"], list) else []:
                    entry["id"] = changes[entry["id"]]
                for entry in scene["boundary_conditions"]["dirichlet_boundary"]:
                    entry["id"] = changes[entry["id"]]
                for entry in scene.get("output", {}).get("forces", []):
                    for key in {"surfaces", "bodies"} & set(entry):
                        entry[key] = changes[entry[key]]
                done, frame = run(self.folder, scene)
                self.assertEqual(done.returncode, 0, done.stderr)
                with h5py.File(frame) as stored:
                    np.testing.assert_array_equal(stored["fields/x"][()], by_number)
                    kept = {*stored.get("sets/cells", {}), *stored.get("sets/facets", {})}
                    self.assertLessEqual(set(changes.values()), kept)

    def test_from_step(self):
        self.need("gmsh")
        page = (SOURCE / "docs/user-guide.md").read_text()
        section = page[page.index("### From STEP"):]
        section = section[:section.index("\n#", 5)]
        geo, scene, commands = re.findall(r"```(?:json|bash)?\n(.*?)```", section, re.DOTALL)
        (self.folder / "cad.geo").write_text(
            'SetFactory("OpenCASCADE");\nBox(1) = {0, 0, 0, 60, 20, 10};\nCylinder(2) = {45, 10, -1, 0, 0, 12, 5};\n'
            "BooleanDifference(3) = { Volume{1}; Delete; }{ Volume{2}; Delete; };\n"
        )
        self.gmsh("-0", "cad.geo", "-o", "part.step")
        (self.folder / "part.geo").write_text(geo)
        (self.folder / "part.json").write_text(scene)
        commands = commands.splitlines()
        self.assertEqual([command.split()[0] for command in commands], ["gmsh", "itr", "itr"])
        for command in commands:
            done = subprocess.run(command.replace("itr ", f"{ITR} ", 1), shell=True, cwd=self.folder, capture_output=True, text=True)
            self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        self.assertLess(self.error_of_bore(), 0.03)
        shaped = page[page.index("#### Shapes from STEP"):]
        lines = re.search(r"```\n(.*?)```", shaped, re.DOTALL)[1]
        (self.folder / "part.json").write_text(json.dumps(json.loads(scene) | json.loads("{" + lines + "}")))
        told = subprocess.run([ITR, "explain", "part.json"], cwd=self.folder, capture_output=True, text=True).stdout
        self.assertRegex(told, r"cylinder of radius 5 mm around the axis \(-?0, -?0, -?1\)")
        done = subprocess.run([ITR, "run", "part.json", "-o", "part", "--overwrite"], cwd=self.folder, capture_output=True, text=True)
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        self.assertLess(self.error_of_bore(), 0.003)

    def error_of_bore(self):
        """Relative, of the reaction to a load on the bore's wall."""
        forces = (self.folder / "part/forces.csv").read_text().splitlines()
        reaction = dict(zip(forces[0].split(","), forces[-1].split(",")))
        load = 0.5 * np.pi * 10 * 10  # MPa on the bore's wall of 10 mm x pi 10 mm
        return abs(float(reaction["reaction_z"]) / load - 1)

    def test_second_order_from_gmsh(self):
        self.need("gmsh")
        (self.folder / "ball.geo").write_text(
            'SetFactory("OpenCASCADE");\nSphere(1) = {0, 0, 0, 1};\nPhysical Volume("ball") = {1};\nPhysical Surface("skin") = {1};\n'
        )
        scene = {
            "geometry": [{"mesh": "a.msh"}],
            "materials": [{"id": "ball", **MATERIAL}],
            "boundary_conditions": {"dirichlet_boundary": [{"id": "skin", "value": [0, 0, "0.01*t"]}]},
            "time": {"dt": 0.1, "time_steps": 1},
        }
        self.gmsh("-3", "-order", "2", "-clmax", "0.7", "ball.geo", "-o", "a.msh")
        done, _ = run(self.folder, scene)
        self.assertEqual(done.returncode, 2)
        advice = re.search(r"by `(echo .*? gmsh \S+ -)`", done.stderr)
        self.assertTrue(advice, done.stderr)
        subprocess.run(advice[1], shell=True, cwd=self.folder, check=True, capture_output=True)
        straight, by_gmsh = run(self.folder, {**scene, "geometry": [{"mesh": "straight.msh"}]})
        self.assertEqual(straight.returncode, 0, straight.stderr)
        x = h5py.File(by_gmsh)["fields/x"][()]
        scene["geometry"][0]["advanced"] = {"force_linear_geometry": True}
        forced, by_itr = run(self.folder, scene)
        self.assertEqual(forced.returncode, 0, forced.stderr)
        self.assertIn("taken as straight", forced.stderr)
        self.assertEqual(len(h5py.File(by_itr)["fields/x"]), len(x))
        for ending in ("inp", "vtk"):
            self.gmsh("-3", "-order", "2", "-clmax", "0.7", "ball.geo", "-o", f"a.{ending}")
            scene["geometry"][0]["mesh"] = f"a.{ending}"
            if ending == "vtk":  # numbers of entities alone
                scene["materials"], scene["boundary_conditions"] = MATERIAL, {}
            done, frame = run(self.folder, scene)
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertEqual(len(h5py.File(frame)["fields/x"]), len(x))

    def test_simplices(self):
        try:
            import meshio  # noqa: F401
        except ImportError:
            self.skipTest("no meshio")
        scene = {
            "geometry": [{"mesh": "a.inp"}],
            "materials": [{"id": "A", **MATERIAL}, {"id": "B", **MATERIAL, "E": 2e6}],
            "boundary_conditions": {
                "dirichlet_boundary": [{"id": "left", "value": [0, 0, 0]}, {"id": "right", "value": ["0.1*t", 0, 0]}]
            },
            "time": {"dt": 1, "time_steps": 1, "quasistatic": True},
            "space": {"discr_order": 2},
        }
        for order in (1, 2):
            hexahedra(self.folder / "a.inp", order)
            done, _ = run(self.folder, scene)
            self.assertEqual(done.returncode, 2)
            advice = re.search(r"`python3 (-m itr\.simplices a\.inp new\.msh)`", done.stderr)
            self.assertTrue(advice, done.stderr)
            subprocess.run([sys.executable, *advice[1].split()], cwd=self.folder, check=True)
            done, frame = run(self.folder, {**scene, "geometry": [{"mesh": "new.msh"}]})
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertNotIn("turned", done.stderr)
            with h5py.File(frame) as stored:
                cells, rest = stored["mesh/simplices"][()], stored["mesh/rest"][()]
                edges = rest[cells[:, 1:]] - rest[cells[:, :1]]
                self.assertAlmostEqual(np.linalg.det(edges).sum() / 6, 16)
                self.assertEqual(len(stored["mesh/surface"]), 2 * 10)
                self.assertEqual(sorted(stored["sets/cells"]), ["A", "B"])
                self.assertEqual([len(stored["sets/facets"][name]) for name in ("left", "right")], [2, 2])

    def test_names_of_any_character(self):
        names = ["Load Face", "a/b", "a_b", "a%2Fb", ".", "<&'>"]
        sets = "".join(f"*NSET, NSET={name}\n{i // 3 + 1}, {i % 3 + 2}\n" for i, name in enumerate(names))
        deck = "*NODE\n1, 0, 0\n2, 1, 0\n3, 1, 1\n4, 0, 1\n*ELEMENT, TYPE=CPS3\n1, 1, 2, 3\n2, 1, 3, 4\n"
        (self.folder / "a.inp").write_text(deck + sets)
        scene = {
            "geometry": [{"mesh": "a.inp"}],
            "materials": MATERIAL,
            "boundary_conditions": {"dirichlet_boundary": [{"id": name, "value": [0, 0]} for name in names]},
            "time": {"dt": 0.1, "time_steps": 1},
            "output": {"paraview": {"vtu": True}},
        }
        done, frame = run(self.folder, scene)
        self.assertEqual(done.returncode, 0, done.stderr)
        with h5py.File(frame) as stored:
            self.assertEqual({*stored["sets/facets"], *stored["sets/vertices"]}, {"Load Face", "a%2Fb", "a_b", "a%252Fb", "%2E", "%3C%26%27%3E"})
        certified = subprocess.run([ITR, "certify", self.folder / "out"], capture_output=True, text=True)
        self.assertEqual(certified.returncode, 0, certified.stderr)

    def test_vtu_there_and_back(self):
        hexahedra(self.folder / "a.inp", 1)
        text = (self.folder / "a.inp").read_text().replace("C3D8", "C3D4")
        text = re.sub(r"\*ELEMENT, TYPE=C3D4, ELSET=B\n.*\n", "", text)
        text = re.sub(r"(TYPE=C3D4, ELSET=A\n)1, (\d+), (\d+), \d+, (\d+), (\d+),.*", r"\g<1>1, \2, \3, \4, \5", text)
        text = re.sub(r"\*NSET, NSET=right\n(?:.*\n)*", "", text)
        (self.folder / "a.inp").write_text(text)
        scene = {
            "geometry": [{"mesh": "a.inp"}],
            "materials": [{"id": "A", **MATERIAL}],
            "boundary_conditions": {"dirichlet_boundary": [{"id": "left", "value": [0, 0, 0]}]},
            "time": {"dt": 0.1, "time_steps": 1},
            "output": {"paraview": {"vtu": True}},
        }
        done, frame = run(self.folder, scene)
        self.assertEqual(done.returncode, 0, done.stderr)
        shutil.copy(self.folder / "out/vtu/000000.vtu", self.folder / "b.vtu")
        again, other = run(self.folder, {**scene, "geometry": [{"mesh": "b.vtu"}]})
        self.assertEqual(again.returncode, 0, again.stderr)
        with h5py.File(other) as stored:
            self.assertEqual(list(stored["sets/cells"]), ["A"])
            self.assertEqual([len(stored["sets/facets/left"]), len(stored["mesh/simplices"])], [1, 1])


if __name__ == "__main__":
    unittest.main()
