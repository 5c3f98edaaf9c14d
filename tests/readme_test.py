#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""README's "Not there yet" names every key and every combination that is refused. Argument: the source folder."""
import pathlib
import re
import sys
import unittest

SOURCE = pathlib.Path(sys.argv.pop())


class Refusals(unittest.TestCase):
    def test_each_is_named(self):
        section = (SOURCE / "README.md").read_text().partition("## Not there yet")[2].partition("\n## ")[0]
        words = set(re.findall(r"[\w/]+", section))
        keys = (SOURCE / "src/scene/known_keys.cpp").read_text()
        refused = re.findall(r'Role::refused,\s*"([^"]*)"', keys)
        only = re.findall(r'Role::only,\s*((?:"(?:[^"\\]|\\.)*"\s*)+)', keys)
        self.assertTrue(refused and only, "the table of keys has another form: read it in another way")
        for name in " ".join(refused).split():
            self.assertIn(name, words)
        units = {"length", "mass", "time"}  # of /units, named as one
        for name in set(re.findall(r"(\w+)=", " ".join(only))) - units - {"boundary_only", "solver"}:
            if "quadrature_order" in name or name == "n_boundary_samples":
                name = "quadratures"
            self.assertIn(name, words)
        places = re.findall(r'refuse\("(/[^"]+)"', (SOURCE / "src/simulation/simulation.cpp").read_text())
        self.assertTrue(places)
        named = re.findall(r"\(`(/[\w/]+)`\)", section)
        self.assertEqual(set(named), set(places), "combinations named, and those that are refused")


if __name__ == "__main__":
    unittest.main()
