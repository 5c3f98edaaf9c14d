# SPDX-License-Identifier: MIT
"""Compares the includes between modules with the module table, the walls around third-party libraries, and include/itr with
the list of public headers.

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

# All headers of include/itr, and the first module in the table that may include each.
PUBLIC = {
    "core.hpp": "core",
    "types.hpp": "core",
    "options.hpp": "core",
    "solver.hpp": "linear",
    "module.h": "linear",
    "mesh.hpp": "mesh",
    "frame.hpp": "mesh",
    "energy.hpp": "fem",
    "contact.hpp": "energy",
    "transfer.hpp": "projection",
    "setup.hpp": "simulation",
    "simulation.hpp": "simulation",
    "output.hpp": "output",
    "scene.hpp": "scene",
    "itr.h": "embed",
    "itr.hpp": "embed",
}
MOST_PUBLIC = 16

# Plain values that describe a simulation are open to `scene`, and made of these alone.
EXTRA = {"scene": {"setup.hpp", "simulation/unsupported.hpp", "energy/elastic/law_table.hpp", "energy/rigid_body.hpp",
                   "energy/support.hpp", "geometry/shape.hpp", "geometry/fit_shape.hpp", "energy/polyfem/ideal_cell.hpp",
                   "energy/polyfem/geometric_contact.hpp"}}
SETUP = {"core.hpp", "energy.hpp", "mesh.hpp", "options.hpp"}

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
    for path in sorted((root / "include" / "itr").iterdir()):
        yield PUBLIC.get(path.name, "include"), path
    for path in sorted((root / "src").rglob("*")):
        if path.suffix in (".hpp", ".cpp"):
            yield path.relative_to(root / "src").parts[0], path


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
    target = PUBLIC.get(header, header.split("/")[0])
    if path.name == "setup.hpp":
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
                yield f"{path.relative_to(root)}: `{module}` may not include {header}"
            for wall, owners in WALLS.items():
                if header is None and re.match(wall, name) and module not in owners:
                    yield f"{path.relative_to(root)}: <{name}> belongs behind {', '.join(sorted(owners))}"


def find_stray_headers(include):
    """Headers of include/itr that the list does not have, and internal ones that its headers include."""
    found = {str(path.relative_to(include)) for path in include.rglob("*") if path.is_file()}
    for name in sorted(found ^ set(PUBLIC)):
        yield f"include/itr/{name}: " + ("not in the list of public headers" if name in found else "not there")
    if len(found) > MOST_PUBLIC:
        yield f"include/itr has {len(found)} headers, more than {MOST_PUBLIC}"
    for name in sorted(found):
        for kind, included in INCLUDE.findall((include / name).read_text()):
            if included.startswith("itr/") and included[len("itr/"):] not in PUBLIC:
                yield f"include/itr/{name}: {included} is not public"
            elif kind == '"' and not included.startswith("itr/"):
                yield f'include/itr/{name}: "{included}" is not installed'


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
