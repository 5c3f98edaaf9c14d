#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Stored results: each says the commit that it was made at and the hash of the sources that it depends on, none a path of the
machine that made it, and the pages show what the files have. Results of other sources than these are listed, and fail nothing:
to measure again takes hours. Argument: the source folder."""
import csv
import fnmatch
import importlib.util
import json
import math
import pathlib
import re
import sys
import tempfile
import unittest

SOURCE = pathlib.Path(sys.argv.pop())
sys.path.insert(0, str(SOURCE / "verification"))
from harness import report, stored  # noqa: E402



def load(path):
    spec = importlib.util.spec_from_file_location(path.replace("/", "_").removesuffix(".py"), SOURCE / "verification" / path)
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # dataclasses look their module up
    spec.loader.exec_module(module)
    return module


paper, studies, stability, needs = (load(path) for path in ("paper/run.py", "paper/studies.py", "stability/table.py", "needs/run.py"))


# Made before commits were stored with them: to be made again.
UNKNOWN = {"verification/solvers/results.csv"}
MACHINE = re.compile(r"(?<![\w.}])/(work|home|root|tmp|mnt|Users|private)/")


def unsaid(what, made):
    """What a stored result does not say of how it was made; empty where nothing is missing."""
    commit, _, sources = made.partition(" ")
    if what in UNKNOWN and commit == "unknown":
        return ""
    if not re.fullmatch(r"[0-9a-f]{7,40}(-dirty)?", commit):
        return f"{what}: no commit, {made!r}"
    if sources:
        return "" if re.fullmatch(r"[0-9a-f]{12}", sources) else f"{what}: no hash of sources, {made!r}"
    if commit.endswith("-dirty"):
        return ""  # of sources that nobody has any more: listed as stale
    return f"{what}: no hash of sources, {made!r}"


class Stored(unittest.TestCase):
    def test_each_says_what_it_was_made_of(self):
        if stored.git("rev-parse") is None:
            self.skipTest("not a git repository")
        all_made = [(what, made) for path in stored.STORED for what, _, made in stored.made_of(path)]
        self.assertEqual([words for what, made in all_made if (words := unsaid(what, made))], [])
        for what, made, changes in stored.ages():
            if changes is None:
                print(f"stale: {what} was made at {made}, of sources that this repository does not have")
            elif changes > 0:
                print(f"stale: {what} was made at {made}, {changes} commits to what it depends on ago")

    def test_what_is_unsaid_is_found(self):
        fine = "ef3c423 0123456789ab"
        self.assertEqual(unsaid("a", fine), "")
        for broken in ("", "unknown", "ef3c423", "ef3c423 ", " 0123456789ab", "ef3c423 0123", "2026-11-23 0123456789ab"):
            self.assertNotEqual(unsaid("a", broken), "", broken)

    def test_all_that_is_stored_is_counted(self):
        folder = SOURCE / "verification"
        names = ("*.csv", "study.json", "results.json")
        files = [str(path.relative_to(SOURCE)) for name in names for path in folder.rglob(name)]
        beside = lambda path: any(fnmatch.fnmatch(path, pattern) for pattern in stored.BESIDE)
        self.assertEqual([path for path in files if path not in stored.STORED and not beside(path)], [])

    def test_nothing_stored_holds_a_path_of_a_machine(self):
        folder = "/".join(("", "work", "tree"))
        self.assertTrue(MACHINE.search(f'"reason": "{folder}/results/x"'))
        self.assertFalse(MACHINE.search(f"../shared{folder} and and/or, 1{folder}"))
        found = []
        for path in (SOURCE / "verification").rglob("*"):
            if path.suffix in (".csv", ".json", ".md", ".svg", ".html", ".txt") and "__pycache__" not in path.parts:
                hit = MACHINE.search(path.read_text(errors="replace"))
                found += [f"{path.relative_to(SOURCE)}: {hit.group()}"] if hit else []
        self.assertEqual(found, [])

    def test_sources_that_change_change_the_hash(self):
        root = stored.ROOT
        with tempfile.TemporaryDirectory() as name:
            stored.ROOT = pathlib.Path(name)
            try:
                if stored.git("init", "-q") is None:
                    self.skipTest("no git")
                (stored.ROOT / "src").mkdir()
                for file in ("src/a.cpp", "src/b.cpp", "README.md"):
                    (stored.ROOT / file).write_text("1")
                stored.git("add", ".")
                stored.git("-c", "user.name=a", "-c", "user.email=a@b", "commit", "-q", "-m", "one")
                first = stored.sources(["src"])
                self.assertRegex(first, "^[0-9a-f]{12}$")
                self.assertEqual(first, stored.sources(["src"], "HEAD"))
                (stored.ROOT / "README.md").write_text("2")
                self.assertEqual(first, stored.sources(["src"]))
                (stored.ROOT / "src/b.cpp").write_text("2")
                self.assertNotEqual(first, stored.sources(["src"]))
                self.assertEqual(first, stored.sources(["src"], "HEAD"))
                (stored.ROOT / "src/b.cpp").unlink()
                self.assertNotEqual(first, stored.sources(["src"]))
            finally:
                stored.ROOT = root

    def test_pages_show_what_is_stored(self):
        folder = SOURCE / "verification"
        page = (folder / "paper/README.md").read_text()
        for name, table in (("results", paper.table), ("curves", paper.curves_table)):
            with open(folder / f"paper/{name}.csv", newline="") as file:
                rows = [paper.typed(row) for row in csv.DictReader(file)]
            for line in table(rows).splitlines():
                self.assertIn(line, page)
        content = json.loads((folder / "report/results.json").read_text())
        blocks = list(report.blocks(content["cases"], content["overview"]))
        self.assertEqual((folder / "report/report.md").read_text(), report.markdown(blocks))
        self.assertEqual((folder / "report/report.html").read_text(), report.html_page(blocks, folder / "report"))

    def test_pages_of_studies_and_hard_cases(self):
        folder = SOURCE / "verification"
        self.assertEqual((folder / "paper/studies.md").read_text(), studies.page())
        self.assertEqual((folder / "stability/table.md").read_text(), stability.table(stability.read(folder / "stability/results.csv")))
        self.assertEqual((folder / "needs/table.md").read_text(), needs.table(needs.read(folder / "needs/results.csv")))

    def test_page_of_peers(self):
        folder = SOURCE / "verification/peers"
        sys.path.insert(0, str(folder))
        page = load("peers/page.py")
        rows, references = ([*csv.DictReader((folder / name).read_text().splitlines())] for name in ("results.csv", "references.csv"))
        text = (folder / "README.md").read_text()
        for table in (page.equal_table(rows, references), page.references_table(references), page.runs_table(rows)):
            self.assertIn(table, text)
        referee = [*csv.DictReader((folder / "referee.csv").read_text().splitlines())]
        self.assertIn(page.referee_table(referee), text)
        self.assertIn("In {1} of these {0} rows".format(*page.count_first(rows, references)), text)
        # An error that is small by chance counts as much as that of the next finer mesh.
        levels = [("0.1", "0.2"), ("1", "-0.001"), ("10", "0.05")]
        made = [{"case": "ring", "code": "ITR", "elements": "linear", "processor_seconds": s, "error": e} for s, e in levels]
        self.assertEqual(page.series(made, "ring")["ITR", "linear"], [(0.1, 0.2), (1, 0.05), (10, 0.05)])
        self.assertAlmostEqual(page.seconds_for([(0.1, 0.2), (1, 0.05)], 0.1), math.sqrt(0.1))
        self.assertEqual(page.seconds_for([(0.1, 0.2), (1, 0.05)], 0.3), 0.1)
        self.assertIsNone(page.seconds_for([(0.1, 0.2), (1, 0.05)], 0.01))

    def test_counts_what_changed_since(self):
        if stored.git("rev-parse", "HEAD~5") is None:
            self.skipTest("not a git repository, or one without history")
        everything = ["."]
        self.assertEqual(stored.changes_since("HEAD", everything), 0)
        self.assertGreaterEqual(stored.changes_since("HEAD~5", everything), 1)
        self.assertIsNone(stored.changes_since("0000000", everything))


if __name__ == "__main__":
    unittest.main()
