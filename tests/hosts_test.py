# SPDX-License-Identifier: MIT
"""Runs a program of examples/hosts where the module that it needs is installed.

usage: hosts_test.py MODULE PROGRAM
"""

import importlib.util
import subprocess
import sys

if __name__ == "__main__":
    for module in (sys.argv[1], "scipy"):
        if importlib.util.find_spec(module) is None:
            print(f"skipped: {module} is not installed")
            sys.exit(77)
    sys.exit(subprocess.run([sys.executable, sys.argv[2]]).returncode)
