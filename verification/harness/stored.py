# SPDX-License-Identifier: MIT
"""What is stored of earlier runs, the commit that each was made at, and how much of what it depends on changed since."""
import csv
import json
import pathlib
import subprocess

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
CODE = ("src", "include", "backends")
LINEAR = ("src/linear", "include/itr/linear", "backends")

# File, and what of the project its figures depend on. A case of the report has its own test file in it too.
STORED = {
    "verification/report/results.json": CODE,
    "verification/paper/results.csv": CODE,
    "verification/newton/results.csv": ("src/newton", "include/itr/newton"),
    "verification/newton/squeeze.csv": ("src/newton", "include/itr/newton", "src/energy", "include/itr/energy", "src/geometry"),
    "verification/scaling/results.csv": LINEAR,
    "verification/solvers/results.csv": LINEAR,
    "verification/solvers/end_to_end.csv": LINEAR,
    "verification/stability/results.csv": CODE,
    "verification/needs/results.csv": CODE,
    **{str(path.relative_to(ROOT)): CODE for path in sorted((ROOT / "verification/paper").glob("*/study.json"))},
}


def git(*arguments):
    """What git prints, or None where it fails (an unknown commit, no repository, no git)."""
    try:
        done = subprocess.run(["git", "-C", str(ROOT), *arguments], capture_output=True, text=True)
    except FileNotFoundError:
        return None
    return done.stdout.strip() if done.returncode == 0 else None


def commit():
    """Of the sources as they are, with `-dirty` where they are changed; empty outside of a repository. Results are no sources:
    one that is written while others still run does not mark theirs."""
    made = git("describe", "--always")
    if not made:
        return ""
    return made if git("diff", "--quiet", "HEAD", "--", *CODE, "verification/*.py") is not None else made + "-dirty"


def commits_of(path):
    """Pairs of what a stored file has and the commit that it was made at."""
    if path.endswith(".json"):
        content = json.loads((ROOT / path).read_text())
        if "cases" not in content:
            return [(path, content.get("commit", ""))]
        cases = content["cases"]
        return [(f"{path}: {name}", case.get("versions", {}).get("itr", "")) for name, case in cases.items()]
    with open(ROOT / path, newline="") as file:
        rows = list(csv.DictReader(file))
    made = sorted({row.get("commit") or "" for row in rows})
    # Files from before there was such a column: made no later than they were stored.
    return [(path, one or git("log", "-1", "--format=%h", "--", path) or "") for one in made]


def changes_since(made, paths):
    """Commits to these paths after one, uncommitted changes at the time not counted; None where git does not know it."""
    count = git("rev-list", "--count", f"{made.removesuffix('-dirty')}..HEAD", "--", *paths)
    return None if count is None else int(count)


def ages():
    """(what, commit, changes since or None) of all that is stored."""
    for path, depends in STORED.items():
        for what, made in commits_of(path):
            case = [f"verification/cases/{what.rpartition(' ')[2]}.py"] if what != path and path.endswith(".json") else []
            yield what, made, changes_since(made, [*depends, *case]) if made else None
