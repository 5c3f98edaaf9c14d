# SPDX-License-Identifier: MIT
"""What the shared library exports: the functions of itr.h, each of which a test names; of C++ what headers in include/itr mark
with ITR_EXPORT, and its SONAME.

usage: exports_test.py SOURCE_DIR SHARED_LIBRARY
"""

import pathlib
import re
import subprocess
import sys

NAMESPACES = {"linear", "scene", "output"}


def run(*command):
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout


def without_comments(path):
    return re.sub(r"//[^\n]*|/\*.*?\*/", "", path.read_text(), flags=re.DOTALL)


def marked(text):
    """Names of the classes and functions that are marked in a header."""
    return set(re.findall(r"\b(?:class|struct) ITR_EXPORT (\w+)", text)) | set(
        re.findall(r"^ITR_EXPORT [^;({]*?\b(\w+)\(", text, re.MULTILINE))


def entity(symbol):
    """The class or function of itr that a symbol belongs to: Mesh of itr::Mesh<2>::apply(...)."""
    match = re.match(r"_Z(?:NK?|T[ISV]N)3itr", symbol)
    rest, name = symbol[match.end():] if match else "", None
    while digits := re.match(r"\d+", rest):
        end = digits.end() + int(digits[0])
        name, rest = rest[digits.end():end], rest[end:]
        if name not in NAMESPACES:
            break
    return name


def main():
    root, shared = pathlib.Path(sys.argv[1]), sys.argv[2]
    headers = {path.name: without_comments(path) for path in (root / "include/itr").iterdir()}
    symbols = [line.split()[-1] for line in run("nm", "-D", "--defined-only", shared).splitlines()]
    functions = {name for name in symbols if name.startswith("itr_")}
    entities = {entity(symbol) for symbol in set(symbols) - functions}
    declared = set(re.findall(r"ITR_C_API\s[^;(]*?\b(itr_\w+)\(", headers["itr.h"]))
    names = set().union(*(marked(text) for text in headers.values()))
    tests = "\n".join(path.read_text() for path in (root / "tests").glob("*.cpp"))
    dynamic = run("readelf", "-d", shared)
    soname = re.search(r"SONAME\).*\[(.*)\]", dynamic)
    failures = []
    if len(declared) < 40 or len(names) < 30:
        failures.append(f"only {len(declared)} functions and {len(names)} names were found in the headers")
    for title, found in [
        ("declared and not there", declared - functions),
        ("there and not declared", functions - declared),
        ("in no test", {name for name in declared if not re.search(rf"\b{name}\b", tests)}),
        ("marked and not exported", names - entities),
        ("exported and not marked", {str(name) for name in entities - names}),
    ]:
        if found:
            failures.append(f"{title}: {' '.join(sorted(found)[:10])}")
    if not soname or soname.group(1) != "libitr.so.0.2":
        failures.append(f"SONAME is {soname and soname.group(1)}, not libitr.so.0.2")
    print("\n".join(failures) or f"{len(functions)} functions of C, {len(symbols) - len(functions)} symbols of {len(names)} names of C++")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
