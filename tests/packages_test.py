#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""cpack's Debian packages hold what their names say; unpacked into a fresh folder, command, modules, Python and library work there.

usage: packages_test.py CPACK BUILD_DIR SOURCE_DIR
"""

import os
import pathlib
import re
import subprocess
import sys
import tempfile
import unittest

CPACK, BUILD, SOURCE = sys.argv.pop(1), pathlib.Path(sys.argv.pop(1)), pathlib.Path(sys.argv.pop(1))
SKIPPED = 77


def call(*arguments, **options):
    done = subprocess.run([str(a) for a in arguments], capture_output=True, text=True, **options)
    if done.returncode:
        raise AssertionError(f"{arguments} ends with {done.returncode}\n{done.stdout}\n{done.stderr}")
    return done.stdout


class Packages(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.root = pathlib.Path(cls.folder.name) / "root"
        call(CPACK, "-G", "DEB", "--config", BUILD / "CPackConfig.cmake", "-B", cls.folder.name, cwd=cls.folder.name)
        cls.packages = {path.name.partition("_")[0]: path for path in pathlib.Path(cls.folder.name).glob("*.deb")}
        for package in cls.packages.values():
            call("dpkg-deb", "-x", package, cls.root)
        cls.scene = cls.root / "usr/share/itr/examples/first.json"
        cls.environment = {key: value for key, value in os.environ.items() if not key.startswith(("ITR_", "PYTHONPATH"))}

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    def field(self, package, name):
        return call("dpkg-deb", "-f", self.packages[package], name).strip()

    def test_each_says_what_it_needs(self):
        self.assertLessEqual({"itr", "libitr0.2", "libitr-dev"}, set(self.packages))
        self.assertIn("libhdf5", self.field("itr", "Depends"))
        self.assertIn("libtbb", self.field("libitr0.2", "Depends"))
        self.assertRegex(self.field("libitr-dev", "Depends"), r"libitr0\.2 \(= 0\.2\.0-1\)")

    def test_each_has_its_own_files(self):
        owner = {}
        for name, package in self.packages.items():
            for line in call("dpkg-deb", "-c", package).splitlines():
                path = line.split(maxsplit=5)[5].partition(" -> ")[0]
                if not path.endswith("/"):
                    self.assertNotIn(path, owner, f"in {name} and {owner.get(path)}")
                    owner[path] = name
        ends = {"bin/itr": "itr", "doc/itr/README.md": "itr", "libitr.so.0.2": "libitr0.2", "include/itr/itr.h": "libitr-dev",
                "cmake/itr/itrConfig.cmake": "libitr-dev", "libitr.a": "libitr-dev", "libitr.so": "libitr-dev"}
        for end, name in ends.items():
            self.assertEqual([owner[path] for path in owner if path.endswith("/" + end)], [name], end)

    def test_the_command_runs(self):
        command = self.root / "usr/bin/itr"
        self.assertRegex(call(command, "--version", env=self.environment), r"^\d+\.\d+\.\d+( \(\w+(-dirty)?\))?\n$")
        results = pathlib.Path(self.folder.name) / "results"
        call(command, "run", self.scene, "-o", results, "--set", "/time/tend=0.23", env=self.environment)
        self.assertIn("no intersection", call(command, "certify", results, env=self.environment))
        if "itr-backends" in self.packages:
            solvers = call(command, "solvers", env=self.environment)
            built = {path.stem.replace("itr_backend_", "") for path in (BUILD / "lib/itr/backends").glob("*.so")}
            for name in built & {"cholmod", "umfpack", "mumps"}:
                self.assertNotRegex(solvers, rf"(?m)^{name}\S* +absent")

    def test_python_runs(self):
        if "python3-itr" not in self.packages:
            self.skipTest("no Python package in this build")
        program = f"import itr; s = itr.Simulation(itr.Model.from_scene({str(self.scene)!r})); print(s.step()['vertices'], itr.__file__)"
        path = {"PYTHONPATH": str(self.root / "usr/lib/python3/dist-packages")}
        output = call(sys.executable, "-c", program, env={**self.environment, **path})
        self.assertRegex(output, r"^91 ")
        self.assertIn(str(self.root), output)

    def test_a_program_links(self):
        [library] = self.root.glob("usr/lib/**/libitr.so.0.2")
        name = re.search(r"SONAME\s+(\S+)", call("objdump", "-p", library))[1]
        self.assertEqual(name, "libitr.so.0.2")
        program = pathlib.Path(self.folder.name) / "bounce"
        call("cc", SOURCE / "examples/api/bounce.c", "-I", self.root / "usr/include", "-L", library.parent, "-litr", "-lm",
             f"-Wl,-rpath,{library.parent}", "-o", program)
        call(program, env=self.environment)


if __name__ == "__main__":
    if subprocess.run(["which", "dpkg-deb", "dpkg-shlibdeps"], capture_output=True).returncode:
        print("skipped: no dpkg-dev here")
        sys.exit(SKIPPED)
    unittest.main()
