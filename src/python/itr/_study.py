# SPDX-License-Identifier: MIT
"""Studies of speed against error."""

from __future__ import annotations

import json
import os
import pathlib
import shutil
import subprocess
from typing import Any, Mapping, Optional, Union

from ._itr import InputError

Path = Union[str, pathlib.Path]


def study(
    scene: Path,
    folder: Path,
    overrides: Optional[Mapping[str, Any]] = None,
    command: Optional[Path] = None,
    **options: Any,
) -> dict:
    """Runs the command `itr study`, each run of it in a process of its own, and returns what it leaves in `folder`/study.json. It
    goes on where it was stopped. `overrides`: values by JSON pointer. `options`: those of `itr study --help`, with lists as
    lists: levels=2, series=["uniform", "itr"], time_limit=60. `command`: the program `itr`; else that of the prefix of this
    package, or the one on PATH. InputError says what is wrong in the scene or in the options."""
    arguments = []
    for name, value in options.items():
        text = ",".join(str(v) for v in value) if isinstance(value, (list, tuple)) else str(value)
        arguments += [f"--{name.replace('_', '-')}", text]
    for pointer, value in (overrides or {}).items():
        arguments += ["--set", f"{pointer}={json.dumps(value)}"]
    program = str(command or _find_command())
    done = subprocess.run([program, "study", str(scene), "-o", str(folder), *arguments], capture_output=True, text=True)
    if done.returncode == 2:
        raise InputError(done.stderr.strip())
    if done.returncode:
        raise RuntimeError(f"itr study: {done.stderr.strip()}")
    return json.loads((pathlib.Path(folder) / "study.json").read_text())


def _find_command() -> str:
    """Of the prefix/lib/pythonX.Y/site-packages/itr or the build/python/itr that this is in."""
    here = pathlib.Path(__file__).resolve()
    for prefix in (here.parents[4], here.parents[2]):
        if os.access(prefix / "bin" / "itr", os.X_OK):
            return str(prefix / "bin" / "itr")
    found = shutil.which("itr")
    if not found:
        raise InputError("command: found no program `itr` in the prefix of the package or on PATH; expected one")
    return found
