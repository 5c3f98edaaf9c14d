# SPDX-License-Identifier: MIT
"""Loads the extension module `itr._itr`: the one for AVX2 where the package has it and the processor can run it."""

import importlib
import pathlib
import sys

NEEDED = {"abm", "avx2", "bmi1", "bmi2", "f16c", "fma", "movbe"}  # of x86-64-v3, as Linux spells them


def _flags():
    try:
        lines = pathlib.Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return set()
    return next((set(line.split(":")[1].split()) for line in lines if line.startswith("flags")), set())


if (pathlib.Path(__file__).parent / "x86_64_v3").is_dir() and NEEDED <= _flags():
    sys.modules["itr._itr"] = importlib.import_module("itr.x86_64_v3._itr")
