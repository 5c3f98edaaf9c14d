# SPDX-License-Identifier: MIT
"""Builds the wheel for `pip install .`: CMake makes the extension module and the solver modules whose libraries
are there, this packs them (PEP 517, PEP 427).

ITR_PYTHON_BUILD names a build tree to use; by default one is made in build/python.
"""

import base64
import hashlib
import os
import pathlib
import subprocess
import sysconfig
import tomllib
import zipfile

ROOT = pathlib.Path(__file__).resolve().parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
TAG = f"cp{sysconfig.get_config_var('py_version_nodot')}"
WHEEL_TAG = f"{TAG}-{TAG}-" + sysconfig.get_platform().replace("-", "_").replace(".", "_")


def build_package():
    """Builds package and solver modules; returns the files of the wheel with their names in it."""
    tree = pathlib.Path(os.environ.get("ITR_PYTHON_BUILD") or ROOT / "build" / "python").resolve()
    if not (tree / "CMakeCache.txt").exists():
        subprocess.run(
            ["cmake", "-S", ROOT, "-B", tree, "-D", "CMAKE_BUILD_TYPE=Release", "-D", "ITR_BUILD_TESTS=OFF"], check=True
        )
    jobs = os.environ.get("ITR_JOBS", "2")
    subprocess.run(["cmake", "--build", tree, "--target", "itr_python", "itr_modules", "--", "-j", jobs], check=True)
    files = {f"itr/{path.name}": path for path in sorted((tree / "python/itr").iterdir()) if path.is_file()}
    # The extension module looks for solvers in itr/backends beside itself.
    return files | {f"itr/itr/backends/{path.name}": path for path in sorted((tree / "lib/itr/backends").glob("*.so"))}


def metadata():
    lines = ["Metadata-Version: 2.1", f"Name: {PROJECT['name']}", f"Version: {PROJECT['version']}"]
    lines += [f"Summary: {PROJECT['description']}", f"Requires-Python: {PROJECT['requires-python']}", "License: MIT"]
    return "\n".join(lines + [f"Requires-Dist: {name}" for name in PROJECT["dependencies"]]) + "\n"


def build_wheel(wheel_directory, config_settings=None, metadata_directory=None):
    info = f"{PROJECT['name']}-{PROJECT['version']}.dist-info"
    files = {name: path.read_bytes() for name, path in build_package().items()}
    files[f"{info}/METADATA"] = metadata().encode()
    files[f"{info}/WHEEL"] = f"Wheel-Version: 1.0\nGenerator: itr\nRoot-Is-Purelib: false\nTag: {WHEEL_TAG}\n".encode()
    record = []
    for name, content in files.items():
        digest = base64.urlsafe_b64encode(hashlib.sha256(content).digest()).rstrip(b"=").decode()
        record.append(f"{name},sha256={digest},{len(content)}")
    files[f"{info}/RECORD"] = "\n".join(record + [f"{info}/RECORD,,"]).encode() + b"\n"
    wheel = f"{PROJECT['name']}-{PROJECT['version']}-{WHEEL_TAG}.whl"
    with zipfile.ZipFile(pathlib.Path(wheel_directory) / wheel, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in files.items():
            archive.writestr(name, content)
    return wheel
