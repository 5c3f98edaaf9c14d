#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Texts to users are those of tests/texts.txt: what the command prints, and what the Python package says of wrong input.

usage: [PYTHONPATH=BUILD_DIR/python] texts_test.py ITR SOURCE_DIR [--write]

A case of texts.txt begins with "== name". Its lines "@ base changes" merge changes (JSON) into a scene of BASES and write
scene.json; its lines "$ arguments" run the command in a folder with FILES; "| warnings" keeps the text from the line
"warnings" on. Without such a line it is `run scene.json`, and a run that was refused (no summary, exit 2) does not say so. A
case "== api: name" is the message of an error of bad_input.py. `--write` makes all texts anew.

Masks: the source folder is SOURCE, the folder of the case FOLDER. Numbers that a run computes are #, so all numbers that a run
prints which was not refused are. Lines that are then equal to the line before are left out.
"""
import concurrent.futures
import difflib
import json
import math
import os
import pathlib
import re
import shlex
import subprocess
import sys
import tempfile

try:
    import bad_input  # needs the Python package
except ImportError:
    bad_input = None

MSH = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n"
TET = MSH + "$Nodes\n4\n1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n$EndNodes\n"
ONE = "$Elements\n1\n1 4 2 3 1 1 2"
FILES = {
    "square.obj": "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3\nf 1 3 4\n",
    "line.obj": "v -1 -0.5 0\nv 2 -0.5 0\nl 1 2\n",
    "flat.obj": "v 0 0 0\nv 1 0 0\nv 2 0 0\nv 0 1 0\nf 1 2 4\nf 1 2 3\n",
    "surface.obj": "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 2 4\n",
    "word.obj": "v 0 0 0\nv 1 zero 0\n",
    "range.obj": "v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 9\n",
    "inverted.msh": TET + "$Elements\n1\n1 4 2 3 1 2 1 3 4\n$EndElements\n",
    "cut.msh": MSH + "$Nodes\n4\n1 0 0 0\n2 1 0",
    "cut_elements.msh": TET + ONE,
    "quad.msh": TET + "$Elements\n1\n1 3 2 3 1 1 2 3 4\n$EndElements\n",
    "node.msh": TET + ONE + " 3 7\n$EndElements\n",
    "text.msh": "this is no mesh\n",
    "mesh.step": "solid\n",
    "folder/empty.obj": "",
    "twice.obj": "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3\nf 1 3 4\nf 3 4 1\n",
    "loose.obj": "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3\nf 4 5 6\n",
    "tilted.msh": MSH + "$Nodes\n3\n1 0 0 0\n2 1 0 0\n3 0 1 1\n$EndNodes\n$Elements\n1\n1 2 2 3 1 1 2 3\n$EndElements\n",
    "octagon.obj": "".join(f"v {math.cos(i * math.pi / 4):.6f} {math.sin(i * math.pi / 4):.6f} 0\n" for i in range(8))
    + "v 0 0 0\n" + "".join(f"f 9 {i + 1} {(i + 1) % 8 + 1}\n" for i in range(8)),
    "wall.obj": "v -1 -1 -1\nv 2 -1 -1\nv -1 -1 2\nf 1 2 3\n",
    "number.json": '{"time": {"dt": 1e999}}',
    "twice.json": '{"geometry": [{"mesh": "square.obj", "n_refs": 1, "n_refs": 2}]}',
    "named.msh": MSH + '$PhysicalNames\n3\n1 1 "root"\n1 2 "top"\n2 3 "plate"\n$EndPhysicalNames\n'
    "$Nodes\n4\n1 0 0 0\n2 1 0 0\n3 1 1 0\n4 0 1 0\n$EndNodes\n"
    "$Elements\n4\n1 1 2 1 1 4 1\n2 1 2 2 2 3 4\n3 2 2 3 1 1 2 3\n4 2 2 3 1 1 3 4\n$EndElements\n",
    "comment.json": '{"time": {"dt": 1}, // seconds\n}\n',
    "comma.json": '{"time": {"dt": 1},\n}\n',
    "quote.json": "{'time': {'dt': 1}}\n",
    "quads.obj": "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n",
    "unused.obj": "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 9 9 9\nf 1 2 3\nf 1 3 4\n",
    "cut.json": '{\n  "geometry": [\n',
}
SQUARE = {
    "geometry": [{"mesh": "square.obj", "volume_selection": 1}],
    "materials": [{"id": 1, "type": "NeoHookean", "E": 1e4, "nu": 0.4, "rho": 1000}],
    "time": {"dt": 0.1, "tend": 1},
}
BASES = {
    "square": SQUARE,
    "above_line": SQUARE | {
        "geometry": [
            {"mesh": "square.obj", "volume_selection": 1, "surface_selection": {"threshold": 1e-3},
             "point_selection": [{"id": 9, "box": [[0.5, 0.5], [2, 2]]}]},
            {"mesh": "line.obj", "is_obstacle": True, "surface_selection": 8, "transformation": {"translation": [0, -1]}},
        ],
        "contact": {"enabled": True, "dhat": 1e-3},
    },
    "named": SQUARE | {
        "units": {"length": "mm", "mass": "t", "time": "s"},
        "geometry": [{"mesh": "named.msh"}, {"type": "ground", "height": -0.5, "name": "floor", "is_obstacle": True}],
        "materials": [{"id": "plate", "type": "NeoHookean", "E": 2000, "nu": 0.35, "rho": 1.1e-9}],
        "boundary_conditions": {"dirichlet_boundary": [{"id": "root", "value": [0, 0]}]},
        "contact": {"enabled": True},
    },
}


def merge(scene, changes):
    """The merge patch of RFC 7396."""
    if not isinstance(changes, dict):
        return changes
    merged = dict(scene) if isinstance(scene, dict) else {}
    for key, value in changes.items():
        merged.pop(key, None) if value is None else merged.update({key: merge(merged.get(key), value)})
    return merged


def mask(text, status, command, folder, source):
    text = text.replace(str(folder), "FOLDER").replace(str(source), "SOURCE")
    if command[0] == "run" and status != 2:
        text = re.sub(r"(?<![\w/.])[-+]?\d+(\.\d+)?(e[-+]?\d+)?(?![\w.]*\w/)", "#", text)
    lines = text.splitlines()
    return [line for i, line in enumerate(lines) if i == 0 or line != lines[i - 1]]


def produce(itr, line, folder, source):
    """Lines that a command prints, its exit status, and the warnings that its summary counts."""
    words, _, only = line.partition(" | ")
    command = shlex.split(words.replace("SOURCE", str(source)))
    if command[0] == "run":
        command += ["-o", str(folder / "out")]
    shown = subprocess.run([itr, *command], cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    lines = mask(shown.stdout, shown.returncode, command, folder, source)
    if only:
        lines = lines[lines.index(only):] if only in lines else lines
    if command[0] == "run" and (folder / "out/summary.json").exists():
        summary = json.loads((folder / "out/summary.json").read_text())
        lines.append(f"summary: solver {summary['solver']}, warnings {[w['count'] for w in summary['warnings']]}")
    elif command[0] == "run" and shown.returncode == 2:
        return lines
    elif command[0] == "run":
        lines.append("no summary")
    return [*lines, f"exit {shown.returncode}"]


def make_case(itr, given, source):
    """A case with its texts made anew."""
    made = []
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name).resolve()
        (folder / "folder").mkdir()
        for file, text in FILES.items():
            (folder / file).write_text(text)
        for line in given:
            made.append(line)
            if line.startswith("@ "):
                base, _, changes = line[2:].partition(" ")
                (folder / "scene.json").write_text(json.dumps(merge(BASES[base], json.loads(changes))))
            else:
                made += produce(itr, line[2:], folder, source)
        if not any(line.startswith("$ ") for line in given):
            made += produce(itr, "run scene.json", folder, source)
    return made


def read_cases(text):
    """The head, and the lines of each case by its name."""
    head, *cases = re.split(r"^== ", text, flags=re.M)
    return head, {case.split("\n", 1)[0]: case.split("\n", 1)[1].rstrip("\n").split("\n") for case in cases}


def make_all(itr, source, text):
    head, cases = read_cases(text)
    made = {}
    if bad_input:
        messages = bad_input.messages()
        made = {f"api: {name}": [message] for name, message in messages.items()}
    command = {name: [line for line in lines if line[:2] in ("@ ", "$ ")] for name, lines in cases.items()}
    with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
        asked = {name: given for name, given in command.items() if not name.startswith("api: ")}
        made |= zip(asked, pool.map(lambda given: make_case(itr, given, source), asked.values()))
    if not bad_input:
        made |= {name: lines for name, lines in cases.items() if name.startswith("api: ")}
    order = [name for name in cases if name in made] + [name for name in made if name not in cases]
    return head + "\n".join("== " + "\n".join([name, *made[name]]) + "\n" for name in order)


def main():
    itr, source = (pathlib.Path(path).resolve() for path in sys.argv[1:3])
    golden = source / "tests/texts.txt"
    stored = golden.read_text()
    made = make_all(itr, source, stored)
    if "--write" in sys.argv:
        golden.write_text(made)
        return 0
    difference = list(difflib.unified_diff(stored.split("\n"), made.split("\n"), "tests/texts.txt", "now", lineterm=""))
    sys.stdout.writelines(line + "\n" for line in difference)
    return 1 if difference else 0


if __name__ == "__main__":
    sys.exit(main())
