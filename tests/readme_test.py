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
        keys = (SOURCE / "src/scene/keys.cpp").read_text()
        rows = re.findall(r'"([^"]*)",\s*(refused|only),', keys)
        self.assertEqual({role for _, role in rows}, {"refused", "only"}, "the table of keys has another form")
        units = {"length", "mass", "time"}  # of /units, named as one
        for pointer, _ in rows:
            last = re.search(r"/(?:\{([^}]*)\}|([^/{}]*))$", pointer)
            for name in set((last[1] or last[2]).split(",")) - units - {"boundary_only", "solver"}:
                if "quadrature_order" in name or name == "n_boundary_samples":
                    name = "quadratures"
                self.assertIn(name, words)
        places = re.findall(r'refuse\("(/[^"]+)"', (SOURCE / "src/simulation/simulation.cpp").read_text())
        self.assertTrue(places)
        named = re.findall(r"\(`(/[\w/]+)`\)", section)
        self.assertEqual(set(named), set(places), "combinations named, and those that are refused")


if __name__ == "__main__":
    unittest.main()
