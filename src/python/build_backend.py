# SPDX-License-Identifier: MIT
"""Builds the wheel for `pip install .`: CMake makes the extension module and the solver modules whose libraries
are there, this packs them (PEP 517, PEP 427).

ITR_PYTHON_BUILD names a build tree to use; by default one is made in build/python. `pip wheel . --config-settings
portable=yes` makes a wheel for other machines: the core without solver modules, with all libraries that it needs (portable.py),
for plain x86-64 and for processors with AVX2. It needs patchelf.
"""

import base64
import hashlib
import os
import pathlib
import subprocess
import sysconfig
import tomllib
import zipfile

import portable

ROOT = pathlib.Path(__file__).resolve().parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
TAG = f"cp{sysconfig.get_config_var('py_version_nodot')}"
PLATFORM = sysconfig.get_platform().replace("-", "_").replace(".", "_")


def build_tree(tree, targets, *options):
    """Builds targets in a tree, and returns the package's files with their names in the wheel."""
    if not (tree / "CMakeCache.txt").exists():
        subprocess.run(["cmake", "-S", ROOT, "-B", tree, "-D", "CMAKE_BUILD_TYPE=Release", "-D", "ITR_BUILD_TESTS=OFF", *options], check=True)
    jobs = os.environ.get("ITR_JOBS", "2")
    subprocess.run(["cmake", "--build", tree, "--target", *targets, "--", "-j", jobs], check=True)
    return {f"itr/{path.name}": path for path in sorted((tree / "python/itr").iterdir()) if path.is_file()}


def build_package():
    tree = pathlib.Path(os.environ.get("ITR_PYTHON_BUILD") or ROOT / "build" / "python").resolve()
    files = build_tree(tree, ["itr_python", "itr_modules"])
    # The extension module looks for solvers in itr/backends beside itself.
    files |= {f"itr/itr/backends/{path.name}": path for path in sorted((tree / "lib/itr/backends").glob("*.so"))}
    return {name: path.read_bytes() for name, path in files.items()}


def build_portable_package():
    files = build_tree(ROOT / "build" / "python-x86-64", ["itr_python"], "-D", "ITR_ARCH=x86-64")
    fast = build_tree(pathlib.Path(os.environ.get("ITR_PYTHON_BUILD") or ROOT / "build" / "python").resolve(), ["itr_python"])
    return portable.graft(files | {f"itr/x86_64_v3/{path.name}": path for path in fast.values() if ".so" in path.name})


def metadata():
    lines = ["Metadata-Version: 2.1", f"Name: {PROJECT['name']}", f"Version: {PROJECT['version']}"]
    lines += [f"Summary: {PROJECT['description']}", f"Requires-Python: {PROJECT['requires-python']}", "License: MIT"]
    return "\n".join(lines + [f"Requires-Dist: {name}" for name in PROJECT["dependencies"]]) + "\n"


def build_wheel(wheel_directory, config_settings=None, metadata_directory=None):
    info = f"{PROJECT['name']}-{PROJECT['version']}.dist-info"
    is_portable = (config_settings or {}).get("portable") == "yes"
    files = build_portable_package() if is_portable else build_package()
    wheel_tag = f"{TAG}-{TAG}-{portable.tag() if is_portable else PLATFORM}"
    files[f"{info}/METADATA"] = metadata().encode()
    files[f"{info}/WHEEL"] = f"Wheel-Version: 1.0\nGenerator: itr\nRoot-Is-Purelib: false\nTag: {wheel_tag}\n".encode()
    record = []
    for name, content in files.items():
        digest = base64.urlsafe_b64encode(hashlib.sha256(content).digest()).rstrip(b"=").decode()
        record.append(f"{name},sha256={digest},{len(content)}")
    files[f"{info}/RECORD"] = "\n".join(record + [f"{info}/RECORD,,"]).encode() + b"\n"
    wheel = f"{PROJECT['name']}-{PROJECT['version']}-{wheel_tag}.whl"
    with zipfile.ZipFile(pathlib.Path(wheel_directory) / wheel, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in files.items():
            archive.writestr(name, content)
    return wheel
