# SPDX-License-Identifier: MIT
"""The site of pages and public headers comes without a warning and can be searched, and in those that a program begins with (itr.h, itr.hpp) every function and
type says what it is; fields are described by their struct.

usage: doc_test.py DOXYGEN SOURCE_DIR DOXYFILE
"""

import pathlib
import subprocess
import sys
import tempfile


def complaints(doxygen, settings):
    done = subprocess.run([doxygen, "-"], input=settings, capture_output=True, text=True)
    lines = [line for line in done.stderr.splitlines() if "warning:" in line or "error:" in line]
    return lines + ([f"doxygen ends with {done.returncode}"] if done.returncode else [])


def main():
    doxygen, root, settings = sys.argv[1], pathlib.Path(sys.argv[2]), pathlib.Path(sys.argv[3]).read_text()
    include = root / "include/itr"
    first = " ".join(str(include / name) for name in ["itr.h", "itr.hpp"])
    with tempfile.TemporaryDirectory() as folder:
        settings += f"\nOUTPUT_DIRECTORY = {folder}\n"
        failures = complaints(doxygen, settings)
        if not list(pathlib.Path(folder).glob("html/itr_8h.html")):
            failures.append("no page of itr.h")
        for page in ["tutorial", "scenes", "embedding"]:
            if not list(pathlib.Path(folder).glob(f"html/md*{page}.html")):
                failures.append(f"no page of docs/{page}.md")
        if not list(pathlib.Path(folder).glob("html/search/*.js")):
            failures.append("the site cannot be searched")
        strict = f"INPUT = {first}\nEXTRACT_ALL = NO\nWARN_IF_UNDOCUMENTED = YES\nUSE_MDFILE_AS_MAINPAGE =\n"
        strict += "GENERATE_HTML = NO\nGENERATE_XML = YES\n"
        failures += [line for line in complaints(doxygen, settings + strict) if "(variable)" not in line]
    print("\n".join(failures) or "all pages made")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
