#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Doxygen's filter for pages: Debian's Doxygen knows no GitHub anchors, and warns of links to files outside of the site.

usage: doxygen_filter.py PAGE        prints the page with links to pages of the site, and the others as text with their path
"""

import pathlib
import re
import sys

SOURCE = pathlib.Path(__file__).resolve().parent.parent
FOLDERS = {SOURCE, SOURCE / "docs"}
ALSO = {SOURCE / "examples/README.md", SOURCE / "verification/README.md"}


def replaced(match, page):
    """A link as the site can have it."""
    mark, words, link = match.groups()
    name = link.partition("#")[0]
    if "://" in link:
        return match[0]
    if mark:  # HTML_EXTRA_FILES lays all pictures into one folder
        return f'<img src="{pathlib.Path(link).name}" alt="{words}">'
    target = (page.parent / name).resolve()
    if not name:
        return words
    if target in ALSO or (target.parent in FOLDERS and target.suffix == ".md"):
        return f"[{words}]({name})"
    shown = target.relative_to(SOURCE)
    return words if words.strip("`") == str(shown) else f"{words} (`{shown}`)"


def main():
    page = pathlib.Path(sys.argv[1]).resolve()
    text = page.read_text()
    if page.suffix == ".md":
        text = re.sub(r"(!?)\[([^\]]+)\]\(([^)\s]+)\)", lambda match: replaced(match, page), text)
        text = re.sub(r'<img src="(?!http)[^"]*/', '<img src="', text)
    sys.stdout.write(text)


if __name__ == "__main__":
    main()
