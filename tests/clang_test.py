#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Clang reads all of src/ without an error: syntax only, no code is made.

usage: clang_test.py SOURCE_DIR WORK_DIR [CLANG]; exit 77 where there is no Clang
"""
import concurrent.futures
import json
import os
import pathlib
import shutil
import subprocess
import sys

NAMES = ("clang++-16", "clang++-19", "clang++")


def check(entry):
    """The messages of one file's compile command; empty: no error."""
    done = subprocess.run(f"{entry['command']} -fsyntax-only", shell=True, cwd=entry["directory"], stderr=subprocess.PIPE, text=True)
    return f"{entry['file']}\n{done.stderr}" if done.returncode else ""


def main():
    source, work = (pathlib.Path(path).resolve() for path in sys.argv[1:3])
    clang = sys.argv[3] if len(sys.argv) > 3 else next(filter(None, map(shutil.which, NAMES)), None)
    if not clang:
        print("no Clang")
        return 77
    subprocess.run(["cmake", "-S", source, "-B", work, f"-DCMAKE_CXX_COMPILER={clang}", "-DCMAKE_EXPORT_COMPILE_COMMANDS=ON",
                    "-DCMAKE_DISABLE_PRECOMPILE_HEADERS=ON", "-DITR_BUILD_TESTS=OFF", "-DCMAKE_BUILD_TYPE=Release"], check=True,
                   stdout=subprocess.DEVNULL)
    subprocess.run(["cmake", "--build", work, "--target", "itr_commit"], check=True, stdout=subprocess.DEVNULL)  # a header
    entries = [entry for entry in json.loads((work / "compile_commands.json").read_text())
               if pathlib.Path(entry["file"]).is_relative_to(source / "src")]
    with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
        errors = list(filter(None, pool.map(check, entries)))
    print("\n".join([*errors, f"{clang}: {len(entries)} files, {len(errors)} with errors"]))
    return 1 if errors or not entries else 0


if __name__ == "__main__":
    sys.exit(main())
