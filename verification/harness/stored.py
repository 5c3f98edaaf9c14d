# SPDX-License-Identifier: MIT
"""What is stored of earlier runs: the commit that each was made at, the hash of the sources that it depends on, and what is stale."""
import csv
import functools
import hashlib
import json
import pathlib
import subprocess

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
CODE = ("src", "include", "backends")
LINEAR = ("src/linear", "include/itr/solver.hpp", "include/itr/module.h", "backends")
PAPER = ROOT / "verification/paper"

# File, and what of the project its figures depend on. A case of the report has its own test file in it too.
STORED = {
    "verification/report/results.json": CODE,
    "verification/paper/results.csv": CODE,
    "verification/paper/curves.csv": CODE,
    "verification/newton/results.csv": ("src/newton",),
    "verification/newton/squeeze.csv": ("src/newton", "src/energy", "src/geometry", "verification/newton/bodies.py",
                                        "verification/stability/hard_cases.py"),
    "verification/scaling/results.csv": LINEAR,
    "verification/scaling/machine.csv": CODE,
    "verification/scaling/million.csv": CODE,
    "verification/scaling/ranks.csv": LINEAR,
    "verification/solvers/results.csv": LINEAR,
    "verification/solvers/end_to_end.csv": LINEAR,
    "verification/stability/results.csv": CODE,
    "verification/needs/results.csv": CODE,
    "verification/hard_contact/results-itr.csv": CODE,
    "verification/adaptive/results.csv": CODE,
    "verification/adaptive/accuracy.csv": CODE,
    "verification/peers/results.csv": CODE,
    "verification/peers/references.csv": CODE,
    "verification/peers/referee.csv": CODE,
    **{str(path.relative_to(ROOT)): CODE for path in sorted([*PAPER.glob("*/study.json"), *PAPER.glob("*/steps.csv")])},
}
# Tables that the report's cases and the studies write beside what STORED names, and runs that have a made of their own. Results of
# other codes depend on none of these sources.
BESIDE = ("verification/report/*.csv", "verification/paper/*/study.csv", "verification/hard_contact/results-calculix.csv",
          "verification/hard_contact/results-getfem.csv")


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


def sources(paths, at=None):
    """The hash of the files in these paths, as they are in the working tree or at a commit; empty where git does not know it."""
    if at is None:
        listed = git("ls-files", "-s", "--", *paths)
        changed = git("diff", "--name-only", "HEAD", "--", *paths)
    else:
        listed, changed = git("ls-tree", "-r", at, "--", *paths), ""
    if listed is None or changed is None:
        return ""
    blobs = {}
    for line in listed.splitlines():
        what, _, name = line.partition("\t")
        blobs[name] = what.split()[1 if at is None else 2]
    for name in filter(None, changed.splitlines()):
        if (ROOT / name).exists():
            blobs[name] = git("hash-object", "--", name)
        else:
            blobs.pop(name, None)
    text = "".join(f"{blob} {name}\n" for name, blob in sorted(blobs.items()))
    return hashlib.sha256(text.encode()).hexdigest()[:12]


def made(path, case=None):
    """What is stored with a result: "commit hash", the hash of what STORED says that the file depends on, as it is now."""
    return f"{commit()} {sources(depends_on(path, case))}"


def depends_on(path, case=None):
    return (*STORED.get(path, CODE), *([f"verification/cases/{case}.py"] if case else []))


def made_of(path):
    """(what, case or None, made) of all that a stored file has: "commit hash", or "commit" alone from before there were hashes."""
    if path.endswith(".json"):
        content = json.loads((ROOT / path).read_text())
        if "cases" not in content:
            return [(path, None, content.get("commit", ""))]
        return [(f"{path}: {name}", name, case.get("versions", {}).get("itr", "")) for name, case in content["cases"].items()]
    with open(ROOT / path, newline="") as file:
        rows = list(csv.DictReader(file))
    return [(path, None, one) for one in sorted({row.get("commit") or "" for row in rows})]


def changes_since(at, paths):
    """Commits to these paths after one, uncommitted changes at the time not counted; None where git does not know it."""
    count = git("rev-list", "--count", f"{at.removesuffix('-dirty')}..HEAD", "--", *paths)
    return None if count is None else int(count)


def ages():
    """(what, commit, changes since or None) of all that is stored: 0 only where the sources are the same to the byte."""
    now = functools.cache(sources)
    for path in STORED:
        for what, case, one in made_of(path):
            at, _, then = one.partition(" ")
            paths = depends_on(path, case)
            changes = changes_since(at, paths) if at else None
            if then:
                changes = 0 if then == now(paths) else max(1, changes) if changes is not None else None
            yield what, at, changes
