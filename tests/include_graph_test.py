# SPDX-License-Identifier: MIT
"""Compares the includes between modules with the module table, the walls around third-party libraries, and include/ with what
public headers include.

usage: include_graph_test.py SOURCE_DIR
"""

import pathlib
import re
import sys

# Module -> modules it may include. Dependencies point downward only: each row uses rows above it.
MAY_USE = {
    "core": "",
    "geometry": "core",
    "linear": "core",
    "mesh": "core geometry",
    "fem": "core geometry linear mesh",
    "time": "core",
    "energy": "core geometry linear mesh fem",
    "newton": "core linear energy",
    "projection": "core geometry linear mesh fem energy newton",
    "remesh": "core geometry linear mesh fem energy newton projection",
    "simulation": "core geometry linear mesh fem time energy newton projection remesh",
    "output": "core geometry mesh fem simulation",
    "scene": "core mesh",
    "embed": "core geometry linear mesh fem time energy newton projection remesh simulation output scene",
}

USERS = {"apps", "python"}  # programs over the library: they may use all of it

# Headers that describe a simulation as plain values: open to `scene`, and all that simulation/setup.hpp is made of.
OPTIONS = {
    "energy/contact/options.hpp",
    "energy/damping_options.hpp",
    "energy/host_terms.hpp",
    "energy/material.hpp",
    "fem/options.hpp",
    "linear/options.hpp",
    "newton/options.hpp",
    "output/options.hpp",
    "remesh/options.hpp",
    "time/options.hpp",
}
EXTRA = {"scene": OPTIONS | {"simulation/setup.hpp", "simulation/unsupported.hpp"}, "embed": {"itr.h"}}
SETUP = OPTIONS | {"mesh/mesh.hpp", "core/types.hpp", "core/units.hpp"}

# Headers for programs: these, and those that they include. include/ has nothing else, as all of it is installed.
PUBLIC = {
    "itr.hpp",
    "itr.h",
    "energy/contact/contact.hpp",  # parts that are of use alone
    "projection/transfer.hpp",
    "remesh/remesher.hpp",
    "linear/abi.h",  # for solver modules
    "linear/iteration_options.hpp",
    "linear/module_adapter.hpp",
}

# Third-party header -> the modules that may know it.
WALLS = {
    r"nlohmann/": {"scene", "output", "apps", "embed"},
    r"CGAL/": {"geometry"},
    r"boost/": {"energy", "remesh"},
    r"(oneapi/)?tbb/": {"core"},
    r"hdf5\.h|H5": {"core"},
    r"zlib\.h": {"apps", "mesh"},
    r"CLI/|spdlog/": {"apps"},
}

INCLUDE = re.compile(r'^\s*#\s*include\s*(<|")([^>"]+)[>"]', re.MULTILINE)


def module_files(root):
    """(module, file) of every source of the library and the command."""
    for folder in (root / "include" / "itr", root / "src"):
        for path in sorted(folder.rglob("*")):
            if path.suffix in (".hpp", ".cpp"):
                yield path.relative_to(folder).parts[0], path


def resolve(root, path, kind, name):
    """The included header relative to include/itr or src, or None for a third-party one."""
    if name.startswith("itr/"):
        return name[len("itr/"):]
    if kind == '"':
        for base in (path.parent, root / "src"):
            target = (base / name).resolve()
            if target.is_file() and target.is_relative_to(root / "src"):
                return str(target.relative_to(root / "src"))
    return None


def is_allowed(module, path, header):
    target = header.split("/")[0]
    if path.name == "setup.hpp" and module == "simulation":
        return header in SETUP
    return target == module or target in MAY_USE[module].split() or header in EXTRA.get(module, ())


def find_violations(root):
    for module, path in module_files(root):
        if module not in USERS and module not in MAY_USE:
            if len(path.relative_to(root).parts) > 2 and path.parent.name != "itr":
                yield f"{path.relative_to(root)}: module `{module}` is not in the table"
            continue
        for kind, name in INCLUDE.findall(path.read_text()):
            header = resolve(root, path, kind, name)
            if header and module not in USERS and not is_allowed(module, path, header):
                yield f"{path.relative_to(root)}: `{module}` may not include itr/{header}"
            for wall, owners in WALLS.items():
                if header is None and re.match(wall, name) and module not in owners:
                    yield f"{path.relative_to(root)}: <{name}> belongs behind {', '.join(sorted(owners))}"


def find_stray_headers(include):
    """Headers of include/ that no public header includes, and internal ones that it does."""
    found, todo = set(), set(PUBLIC)
    while todo:
        header = todo.pop()
        found.add(header)
        for kind, name in INCLUDE.findall((include / header).read_text()):
            if name.startswith("itr/"):
                todo.add(name[len("itr/"):])
            elif kind == '"':
                yield f"include/itr/{header}: \"{name}\" is not installed"
        todo = {name for name in todo - found if (include / name).is_file()}
    for path in sorted(include.rglob("*.h*")):
        if str(path.relative_to(include)) not in found:
            yield f"include/itr/{path.relative_to(include)}: no public header includes it, so it belongs in src/"


def check_table():
    """The table itself has no cycle: rows use earlier rows only."""
    seen = set()
    for module, uses in MAY_USE.items():
        assert set(uses.split()) <= seen, f"table: `{module}` uses a later module"
        seen.add(module)


def main():
    root = pathlib.Path(sys.argv[1]).resolve()
    check_table()
    violations = [*find_violations(root), *find_stray_headers(root / "include/itr")]
    print("\n".join(violations) or "the include graph is as the module table says, and include/ is public")
    return 1 if violations else 0


if __name__ == "__main__":
    sys.exit(main())
