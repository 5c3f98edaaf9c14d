# SPDX-License-Identifier: MIT
"""What the shared library shows: the functions of itr.h, each of them; of C++ what public headers name, and nothing else; its
SONAME.

usage: exports_test.py SOURCE_DIR SHARED_LIBRARY STATIC_LIBRARY [--write]

--write makes the list of names in src/itr.map anew, which the linker reads.
"""

import pathlib
import re
import subprocess
import sys

NAMESPACES = {"linear", "scene", "output", "detail", "hdf5"}
KINDS = ("_ZN3itr", "_ZNK3itr", "_ZT[ISV]N3itr")  # functions, const ones, type information and virtual tables
HEAD = """# What the shared library shows: the functions of itr.h, and what the public headers name. tests/exports_test.py --write.
ITR_0 {
  global:
    itr_*;
"""
TAIL = """  local:
    *;
};
"""


def run(*command):
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout


def symbols(*command):
    return {line.split()[-1].split("@")[0] for line in run("nm", "--defined-only", *command).splitlines() if " " in line}


def without_comments(path):
    return re.sub(r"//[^\n]*|/\*.*?\*/", "", path.read_text(), flags=re.DOTALL)


def public_headers(include):
    return {str(path.relative_to(include)): without_comments(path) for path in include.rglob("*.h*")}


def entity(symbol):
    """What a symbol belongs to, as the linker spells it: 4Mesh of itr::Mesh<2>::..., 6linear8Registry. None: not ours."""
    match = re.match(r"_Z(?:NK?|T[ISV]N)3itr", symbol)
    rest, name = symbol[match.end():] if match else "", ""
    while digits := re.match(r"\d+", rest):
        end = digits.end() + int(digits[0])
        name, part, rest = name + rest[:end], rest[digits.end():end], rest[end:]
        if part not in NAMESPACES:
            return name
    return None


def name_of(entity_name):
    """Registry of 6linear8Registry."""
    while digits := re.match(r"\d+", entity_name):
        end = digits.end() + int(digits[0])
        name, entity_name = entity_name[digits.end():end], entity_name[end:]
    return name


def write_map(path, names):
    lines = [f"    {' '.join(f'{kind}{name}*;' for kind in KINDS)}\n" for name in sorted(names)]
    path.write_text(HEAD + "".join(lines) + TAIL)


def main():
    root, shared, static = pathlib.Path(sys.argv[1]), sys.argv[2], sys.argv[3]
    headers = public_headers(root / "include")
    words = set(re.findall(r"\w+", "\n".join(headers.values())))
    entities = {entity(symbol) for symbol in symbols("--extern-only", static)} - {None}
    names = {name for name in entities if name_of(name) in words}
    if "--write" in sys.argv:
        write_map(root / "src/itr.map", names)
        return 0

    shown = symbols("-D", shared) - {"ITR_0"}
    functions = {name for name in shown if name.startswith("itr_")}
    declared = set(re.findall(r"ITR_C_API\s[^;(]*?\b(itr_\w+)\(", headers["itr/itr.h"]))
    dynamic = run("readelf", "-d", shared)
    soname = re.search(r"SONAME\).*\[(.*)\]", dynamic)
    failures = []
    if len(declared) < 40:
        failures.append(f"only {len(declared)} functions were found in itr.h")
    for title, found in [
        ("declared and not there", declared - functions),
        ("there and not declared", functions - declared),
        ("of others", {name for name in shown - functions if entity(name) is None}),
        ("in a public header and not shown: --write", names - {entity(name) for name in shown}),
        ("shown and in no public header: --write", {entity(name) for name in shown - functions} - names - {None}),
    ]:
        if found:
            failures.append(f"{title}: {' '.join(sorted(found)[:10])}")
    if not soname or soname.group(1) != "libitr.so.0":
        failures.append(f"SONAME is {soname and soname.group(1)}, not libitr.so.0")
    print("\n".join(failures) or f"{len(functions)} functions of C, {len(shown) - len(functions)} symbols of C++, "
          f"of {len(entities)} names {len(names)}, in {len(headers)} headers")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
