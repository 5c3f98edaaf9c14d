# SPDX-License-Identifier: MIT
"""Takes the files of the guide out of docs/embedding.md, as a new user copies them.

usage: guide.py SOURCE_DIR FOLDER
"""

import pathlib
import re
import sys


def main():
    root, folder = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2])
    text = (root / "docs/embedding.md").read_text()
    folder.mkdir(parents=True, exist_ok=True)
    for language, name in [("cpp", "main.cpp"), ("cmake", "CMakeLists.txt"), ("python", "host.py")]:
        blocks = re.findall(rf"```{language}\n(.*?)```", text, flags=re.DOTALL)
        if len(blocks) != 1:
            sys.exit(f"docs/embedding.md has {len(blocks)} blocks of {language}, not 1")
        (folder / name).write_text(blocks[0])


if __name__ == "__main__":
    main()
