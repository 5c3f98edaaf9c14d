# SPDX-License-Identifier: MIT
"""What the shared library shows: the functions of itr.h, each of them, and the namespace itr; its SONAME.

usage: exports_test.py SOURCE_DIR LIBRARY
"""

import pathlib
import re
import subprocess
import sys


def main():
    root, library = pathlib.Path(sys.argv[1]), sys.argv[2]
    header = re.sub(r"/\*.*?\*/", "", (root / "include/itr/itr.h").read_text(), flags=re.DOTALL)
    declared = set(re.findall(r"ITR_C_API\s[^;(]*?\b(itr_\w+)\(", header))
    symbols = subprocess.run(["nm", "-D", "--defined-only", library], capture_output=True, text=True, check=True).stdout
    names = {line.split()[-1].split("@")[0] for line in symbols.splitlines()} - {"ITR_0"}
    functions = {name for name in names if name.startswith("itr_")}
    strangers = {name for name in names - functions if not re.match(r"_Z(N|NK|TIN|TSN|TVN)3itr", name)}
    dynamic = subprocess.run(["readelf", "-d", library], capture_output=True, text=True, check=True).stdout
    soname = re.search(r"SONAME\).*\[(.*)\]", dynamic)
    failures = []
    if len(declared) < 40:
        failures.append(f"only {len(declared)} functions were found in itr.h")
    for title, found in [
        ("declared and not there", declared - functions),
        ("there and not declared", functions - declared),
        ("of others", strangers),
    ]:
        if found:
            failures.append(f"{title}: {' '.join(sorted(found)[:10])}")
    if not soname or soname.group(1) != "libitr.so.0":
        failures.append(f"SONAME is {soname and soname.group(1)}, not libitr.so.0")
    print("\n".join(failures) or f"{len(functions)} functions of C, {len(names) - len(functions)} symbols of C++")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
