#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Stored results: each says the commit that it was made at, and the pages show what the files have. Results that are older
than the code are listed, and fail nothing: to measure again takes hours. Argument: the source folder."""
import csv
import importlib.util
import json
import pathlib
import sys
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


class Stored(unittest.TestCase):
    def test_each_says_its_commit(self):
        if stored.git("rev-parse") is None:
            self.skipTest("not a git repository")
        for what, made, changes in stored.ages():
            self.assertTrue(made, f"{what} does not say at which commit it was made")
            if changes is None:
                print(f"stale: {what} was made at {made}, which this repository does not have")
            elif changes > 0 or made.endswith("-dirty"):
                print(f"stale: {what} was made at {made}, {changes} commits to what it depends on ago")

    def test_pages_show_what_is_stored(self):
        folder = SOURCE / "verification"
        with open(folder / "paper/results.csv", newline="") as file:
            rows = [paper.typed(row) for row in csv.DictReader(file)]
        page = (folder / "paper/README.md").read_text()
        for line in paper.table(rows).splitlines():
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

    def test_counts_what_changed_since(self):
        if stored.git("rev-parse", "HEAD~5") is None:
            self.skipTest("not a git repository, or one without history")
        everything = ["."]
        self.assertEqual(stored.changes_since("HEAD", everything), 0)
        self.assertGreaterEqual(stored.changes_since("HEAD~5", everything), 1)
        self.assertIsNone(stored.changes_since("0000000", everything))


if __name__ == "__main__":
    unittest.main()
