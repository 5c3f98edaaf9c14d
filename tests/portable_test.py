#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""A package with grafted libraries imports where it finds no others, with the kernel that the processor can run.

usage: portable_test.py PACKAGE_DIR SOURCE_DIR
"""

import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import unittest

PACKAGE, SOURCE = pathlib.Path(sys.argv.pop(1)), pathlib.Path(sys.argv.pop(1))
SKIPPED = 77
sys.path.insert(0, str(SOURCE / "src/python"))
import portable  # noqa: E402


class Portable(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.root = pathlib.Path(self.folder.name)
        self.addCleanup(self.folder.cleanup)
        files = {f"itr/{path.name}": path for path in PACKAGE.iterdir() if path.is_file()}
        fast = {f"itr/x86_64_v3/{path.name}": path for path in files.values() if ".so" in path.name}
        for name, content in portable.graft(files | fast).items():
            (self.root / name).parent.mkdir(parents=True, exist_ok=True)
            (self.root / name).write_bytes(content)

    def kernel(self):
        return subprocess.run([sys.executable, "-c", "import ssl, itr; print(itr._itr.__name__); itr.Model([[0, 0], [1, 0], [0, 1]], [[0, 1, 2]])"],
                              cwd=self.root, env={"PYTHONPATH": str(self.root)}, check=True, capture_output=True, text=True).stdout.strip()

    def test_finds_all_libraries_inside(self):
        for module in self.root.glob("itr*/**/*.so"):
            paths = re.findall(r"^\s*(\S+) => (.*?)(?: \(0x\w+\))?$", subprocess.run(
                ["ldd", module], check=True, capture_output=True, text=True).stdout, re.MULTILINE)
            outside = [name for name, path in paths if portable.FOLDER not in path and not portable.SYSTEM.match(name)]
            self.assertEqual(outside, [], module.name)

    def test_loads_the_kernel_that_the_processor_can_run(self):
        flags = set(pathlib.Path("/proc/cpuinfo").read_text().split())
        has_all = {"avx2", "bmi1", "bmi2", "f16c", "fma", "movbe", "abm"} <= flags  # x86-64-v3; abm has lzcnt
        self.assertEqual(self.kernel(), "itr.x86_64_v3._itr" if has_all else "itr._itr")
        shutil.rmtree(self.root / "itr/x86_64_v3")
        self.assertEqual(self.kernel(), "itr._itr")


if __name__ == "__main__":
    if not shutil.which("patchelf"):
        print("skipped: no patchelf (tests/install_packages.sh installs it)")
        sys.exit(SKIPPED)
    unittest.main()
