# SPDX-License-Identifier: MIT
"""Puts the shared libraries that a plain machine lacks into a wheel, as manylinux wheels do: copied beside the package, under
names with a digest, so that no other copy in the process is taken for them."""

import hashlib
import pathlib
import platform
import re
import subprocess
import tempfile

SYSTEM = re.compile(r"lib(c|m|dl|rt|pthread|resolv|stdc\+\+|gcc_s)\.so|ld-linux|linux-vdso")
FOLDER = "itr.libs"


def tag():
    """The platform of the wheel: the C library that it is linked with, or a newer one."""
    return f"manylinux_{platform.libc_ver()[1].replace('.', '_')}_{platform.machine()}"


def run(*command):
    return subprocess.run([str(word) for word in command], check=True, capture_output=True, text=True).stdout


def dependencies(binary):
    """Paths by soname of all shared libraries that a binary needs, those of the system left out."""
    found = re.findall(r"^\s*(\S+) => (/\S+)", run("ldd", binary), re.MULTILINE)
    return {name: pathlib.Path(path) for name, path in found if not SYSTEM.match(name)}


def needed(binary):
    return run("patchelf", "--print-needed", binary).split()


def graft(files):
    """Contents of a wheel's files by name, with the libraries that its extension modules need added and found from there."""
    modules = {name: path for name, path in files.items() if ".so" in path.name}
    libraries = {name: path for module in modules.values() for name, path in dependencies(module).items()}
    renamed = {name: f"{name.split('.so')[0]}-{hashlib.sha256(path.read_bytes()).hexdigest()[:8]}.so" for name, path in libraries.items()}
    contents = {name: path.read_bytes() for name, path in files.items() if name not in modules}
    with tempfile.TemporaryDirectory() as folder:
        changed = pathlib.Path(folder) / "changed.so"

        def patched(path, run_path, *options):
            changed.write_bytes(path.read_bytes())
            replaced = [word for name in needed(path) if name in renamed for word in ("--replace-needed", name, renamed[name])]
            for words in (replaced, options, ("--set-rpath", run_path)):  # version 0.14 forgets some of several changes
                if words:
                    run("patchelf", *words, changed)
            return changed.read_bytes()

        for name, path in modules.items():
            contents[name] = patched(path, "/".join(["$ORIGIN", *[".."] * name.count("/"), FOLDER]))
        for name, path in libraries.items():
            contents[f"{FOLDER}/{renamed[name]}"] = patched(path, "$ORIGIN", "--set-soname", renamed[name])
    return contents
