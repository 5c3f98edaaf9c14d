# SPDX-License-Identifier: MIT
"""A comment begins with a verb or with the noun that it defines: never with a word that points at the declaration before it.

usage: comments_test.py SOURCE_DIR
"""
import pathlib
import re
import sys

FOLDERS = ("src", "include", "backends", "tests", "verification", "examples")
ENDINGS = {".hpp", ".cpp", ".h", ".c", ".js", ".py"}
POINTING = re.compile(r"(What|Whoever|That|Those|The same|One of|It|Of)\b")
WHOLE_LINE = re.compile(r"\s*(?:///|//|#)\s?(.*)")
LICENCE = re.compile(r"!|SPDX-")  # lines above a file's own comment
AFTER_CODE = re.compile(r".*[;,{)}]\s+///?<?\s+(.*)")


def pointing_comments(text):
    """(line, comment) of each comment that begins so; lines that go on with a comment do not begin one."""
    in_comment = False
    for number, line in enumerate(text.splitlines(), start=1):
        whole = WHOLE_LINE.fullmatch(line)
        begins = whole if whole and not in_comment else AFTER_CODE.fullmatch(line) if not whole else None
        in_comment = whole is not None and not LICENCE.match(whole[1])
        if begins and POINTING.match(begins[1]):
            yield number, begins[1]


def check_rule():
    bad = ["/// Of the mesh.\nint a;", "int a;  ///< Of the mesh", "# What is left\n", "  // The same in place.\n",
           "// SPDX-License-Identifier: MIT\n// What a file has.\n"]
    good = ["/// Size of the mesh.\n/// Of all, the first.\nint a;", "int a;  ///< of the mesh", "#include <Of>\n", "x = 1  # Often\n",
            "/// Itself a node.\n"]
    for text in bad:
        assert len(list(pointing_comments(text))) == 1, text
    for text in good:
        assert not list(pointing_comments(text)), text


def main():
    check_rule()
    root = pathlib.Path(sys.argv[1])
    paths = [path for folder in FOLDERS for path in sorted((root / folder).rglob("*"))
             if path.suffix in ENDINGS and path.name != "comments_test.py"]
    found = [f"{path.relative_to(root)}:{number}: {comment}" for path in paths
             for number, comment in pointing_comments(path.read_text())]
    print("\n".join(found) or "each comment begins with a verb or a noun")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
