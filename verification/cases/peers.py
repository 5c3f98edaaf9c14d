# SPDX-License-Identifier: MIT
"""PolyFEM's regression scenes, by tests/peer_scenes.py."""
import importlib
import subprocess
import sys

from harness.suite import ROOT, Failure, Result

TITLE = "Peers' scenes"
QUANTITY = "largest deviation of five norms of the final displacement, relative"
REFERENCE = "the values that PolyFEM stores with each scene"
TOLERANCE = "each scene's own margin; refused scenes count as failed"
NEEDS = ()


def results(context):
    program = ROOT / "tests/peer_scenes.py"
    if not program.exists():
        raise Failure(f"{program} is not there")
    scenes = context.data("peer-scenes")
    command = [sys.executable, str(program), "--itr", str(context.build / "bin/itr"), "--scenes", str(scenes)]
    sys.path.insert(0, str(program.parent))
    expected = len(importlib.import_module("peer_scenes").list_scenes(scenes))
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in done.stdout.splitlines() if line.startswith("| ")]
    if len(rows) - 1 != expected:
        raise Failure(f"{len(rows) - 1} of {expected} scenes, exit status {done.returncode}\n{done.stderr}")
    for scene, status, seconds, detail in rows[1:]:
        yield Result(scene, 0.0 if status == "pass" else 1.0, 0.0, status, "pass", f"{detail} ({seconds} s)")
