#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Every command of TUTORIAL.md runs, the scenes it shows are the committed ones, and the forces it quotes come out to 1 %.

usage: tutorial_test.py ITR SOURCE_DIR
"""

import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

TOLERANCE = 0.01  # of a force; linear solvers and round-off change it by much less


def main():
    command, source = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2])
    page = (source / "TUTORIAL.md").read_text()
    shown = [re.findall(rf"```{kind}\n(.*?)```", page, flags=re.DOTALL) for kind in ("bash", "json", "text")]
    commands, scenes, outputs = shown
    failures = [f"{name} is not what the page shows" for name, block in zip(["arch.json", "arch3d.json"], scenes)
                if block != (source / "examples/tutorial" / name).read_text()]
    with tempfile.TemporaryDirectory() as folder:
        root = pathlib.Path(folder)
        shutil.copytree(source / "examples", root / "examples")
        (root / "build/release/bin").mkdir(parents=True)
        (root / "build/release/bin/itr").symlink_to(command)
        done = subprocess.run(["bash", "-euo", "pipefail", "-c", "\n".join(commands)], cwd=root, text=True, capture_output=True)
        if done.returncode:
            sys.exit(f"{done.stdout}\n{done.stderr}\nthe commands end with {done.returncode}")
    line = re.compile(r"^(\w+): ([\d.]+) N at 3 mm", re.MULTILINE)
    found = {name: float(force) for name, force in line.findall(done.stdout)}
    quoted = [pair for output in outputs for pair in line.findall(output)]
    failures += [f"{name}: the page says {force} N, the run {found.get(name)}" for name, force in quoted
                 if abs(found.get(name, 0) - float(force)) > TOLERANCE * float(force)]
    if len(quoted) < 6:
        failures.append("the page quotes fewer forces than it did")
    print("\n".join(failures) or f"{len(quoted)} forces as quoted")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
