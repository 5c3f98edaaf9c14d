#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Pages hold together: links and anchors resolve, README is short and its examples are the committed ones, refusals are listed.

usage: pages_test.py SOURCE_DIR [UNITTEST_ARGUMENT]...
"""

import ast
import csv
import json
import pathlib
import re
import subprocess
import sys
import unittest

SOURCE = pathlib.Path(sys.argv.pop(1)).resolve()
README_WORDS = 700
PICTURE_BYTES = 150_000
MODULES = next(ast.literal_eval(node.value) for node in ast.parse((SOURCE / "tests/include_graph_test.py").read_text()).body
               if isinstance(node, ast.Assign) and node.targets[0].id == "MAY_USE")


def pages():
    """All committed pages, apart from what a build or a run leaves behind."""
    skipped = {"build", "results", ".git", "study"}
    return [path for path in sorted(SOURCE.rglob("*.md")) if not skipped & set(path.relative_to(SOURCE).parts)]


def without_code(text):
    return re.sub(r"`[^`\n]*`", "", re.sub(r"```.*?```", "", text, flags=re.DOTALL))


def anchors(path):
    """Of the headings of a page, as GitHub makes them."""
    found = set()
    for heading in re.findall(r"^#+ (.*)$", re.sub(r"```.*?```", "", path.read_text(), flags=re.DOTALL), re.MULTILINE):
        words = re.sub(r"[^\w\- ]", "", re.sub(r"\[([^]]*)\]\([^)]*\)", r"\1", heading).lower())
        found.add(words.strip().replace(" ", "-"))
    return found


def links(text):
    return re.findall(r"\]\(([^)\s]+)\)", text) + re.findall(r'<(?:img src|a href)="([^"]+)"', text)


def blocks(page, language):
    return re.findall(rf"```{language}\n(.*?)```", (SOURCE / page).read_text(), flags=re.DOTALL)


class Links(unittest.TestCase):
    def test_each_resolves(self):
        for page in pages():
            for link in links(without_code(page.read_text())):
                if re.match(r"https?://|mailto:", link):
                    continue
                with self.subTest(page=str(page.relative_to(SOURCE)), link=link):
                    name, _, anchor = link.partition("#")
                    target = (page.parent / name).resolve() if name else page
                    self.assertTrue(target.exists(), "no such file")
                    if anchor and target.suffix == ".md":
                        self.assertIn(anchor, anchors(target))

    def test_every_page_can_be_reached_from_readme(self):
        reached, queue = set(), [SOURCE / "README.md"]
        while queue:
            page = queue.pop()
            if page in reached or not page.is_file():
                continue
            reached.add(page)
            queue += [(page.parent / link.partition("#")[0]).resolve() for link in links(page.read_text())
                      if link.partition("#")[0].endswith(".md") and "://" not in link]
        top = {*SOURCE.glob("*.md"), *SOURCE.glob("docs/*.md")}
        self.assertEqual(set(), {path.name for path in top - {path.resolve() for path in reached}})


class Readme(unittest.TestCase):
    def setUp(self):
        self.text = (SOURCE / "README.md").read_text()

    def test_is_short(self):
        self.assertLessEqual(len(self.text.split()), README_WORDS)

    def test_has_the_two_commands(self):
        for command in ["bash examples/quickstart.sh", "bash tests/run.sh"]:
            self.assertIn(f"\n{command} ", self.text)

    def test_first_scene_is_the_committed_one(self):
        [block] = blocks("README.md", "json")
        self.assertEqual(block, (SOURCE / "examples/first.json").read_text())
        json.loads(block)

    def test_pictures_are_small(self):
        for picture in sorted((SOURCE / "examples/gallery").iterdir()):
            self.assertLess(picture.stat().st_size, PICTURE_BYTES, picture.name)

    def test_table_is_that_of_the_studies(self):
        done = subprocess.run([sys.executable, SOURCE / "verification/paper/worth.py"], capture_output=True, text=True, check=True)
        self.assertIn(done.stdout, self.text, "verification/paper/worth.py prints the table")

    def test_table_has_what_is_recommended(self):
        done = subprocess.run([sys.executable, SOURCE / "verification/paper/worth.py"], capture_output=True, text=True, check=True)
        rows = {(cells[0], cells[1]): cells for line in (SOURCE / "verification/paper/studies.md").read_text().splitlines()
                if line.startswith("| [") and len(cells := [cell.strip() for cell in line.strip("|").split("|")]) == 8
                and cells[2] in ("itr", "swaps", "smoothing")}
        for name, error in re.findall(r"paper/([\w-]+)/study.md\) \| (\w+) ", done.stdout):
            self.assertNotEqual(rows[f"[{name}]({name}/study.md)", error][7], "nothing recommended", name)

    def test_programs_have_ten_lines(self):
        for language in ["cpp", "python"]:
            [block] = blocks("README.md", language)
            self.assertLessEqual(len(block.splitlines()), 10, language)


def long_functions(path):
    """Names of functions above 60 lines, by the indentation that clang-format gives."""
    lines = path.read_text().splitlines()
    for end, line in enumerate(lines):
        if not re.fullmatch(r"(  ){0,2}\}", line):
            continue
        begin = end - 1
        while begin > 0 and not re.match(line[:-1] + r"(?!//|#|public|private|protected|:)\S", lines[begin]):
            begin -= 1
        name = re.match(r"[^(]*?(\w+)\(", " ".join(lines[begin:end]))
        if end - begin >= 60 and name and not re.match(r"\s*(namespace|class|struct|enum|for|if|while|\})", lines[begin]):
            yield name.group(1)


class Architecture(unittest.TestCase):
    """docs/architecture.md names files, tests and modules that are there."""

    text = (SOURCE / "docs/architecture.md").read_text()

    def test_files_and_tests_exist(self):
        for name in re.findall(r"`((?:src|tests|backends|examples|verification|include)/[\w./*-]+)`", self.text):
            self.assertTrue(list(SOURCE.glob(name)), name)
        for name in re.findall(r"`(\w+_test)`", self.text):
            self.assertTrue((SOURCE / f"tests/{name}.cpp").is_file(), name)

    def test_names_are_those_of_the_code(self):
        code = "\n".join(path.read_text() for folder in ["include", "src", "backends"]
                         for path in (SOURCE / folder).rglob("*.[ch]pp"))
        words = set(re.findall(r"\w+", code))
        for quoted in re.findall(r"`([A-Za-z_:]+(?:\(\))?)`", self.text):
            for name in re.findall(r"\w+", quoted):
                self.assertTrue(name in words or (SOURCE / "tests" / f"{name}.cpp").is_file() or name in MODULES, quoted)

    def test_long_functions_have_a_reason(self):
        reasons = self.text.partition("## Long functions")[2].partition("\n## ")[0]
        found = {name for path in (SOURCE / "src").rglob("*.[ch]pp") for name in long_functions(path)}
        self.assertEqual(found, {name.split("::")[-1] for name in re.findall(r"`([\w:]+)`", reasons)})

    def test_reasons_of_refusals_are_on_their_page(self):
        names = re.search(r"kNames\[\] = \{(.*?)\}", (SOURCE / "src/remesh/edits/edit_checks.cpp").read_text(), re.DOTALL).group(1)
        page = (SOURCE / "docs/theory.md").read_text().partition("## Why an operation was refused")[2]
        for name in set(re.findall(r"\w+", names)) - {"none", "not_asked", "gone"}:  # these are not counted
            self.assertIn(f"`{name}`", page)

    def test_table_of_modules_is_the_tested_one(self):
        rows = dict(re.findall(r"^\| `(\w+)` \|[^|]*\|([^|]*)\|$", self.text, re.MULTILINE))
        for module, uses in rows.items():
            if module not in MODULES or "all above" in uses or "headers" in uses:
                continue
            self.assertEqual(uses.split(), MODULES[module].split(), module)
        self.assertEqual(set(MODULES) - set(rows), set())


class Quotes(unittest.TestCase):
    """Figures in prose are those of the stored results."""

    def test_ratios_to_the_reference(self):
        scenes = ["cantilever", "masticator h=0.1", "ball-wall 2D to t=0.0024", "ball-wall 3D to t=0.00132", "masticator 3D to t=1.1",
                  "twisting-beam to t=0.2, tolerance 10"]
        page = (SOURCE / "verification/paper/README.md").read_text().partition("## Findings")[0]
        rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in page.splitlines() if line.startswith("| ")]
        found = {row[0]: row for row in rows if row[0] in scenes and len(row) > 5}
        self.assertEqual(set(found), set(scenes))
        ratios = {name: int(row[4]) for name, row in found.items()}
        in_2d = sorted(ratios[name] for name in ("masticator h=0.1", "ball-wall 2D to t=0.0024"))
        for page in ["docs/user-guide.md", "verification/README.md"]:
            self.assertIn("{} and {} times as fast".format(*in_2d), (SOURCE / page).read_text().replace("\n", " "))
        text = (SOURCE / "docs/user-guide.md").read_text()
        # A ratio of a window with few steps in contact is told with their number.
        findings = (SOURCE / "verification/paper/README.md").read_text().partition("## Findings")[2].partition("\n## ")[0]
        for name in ["ball-wall 3D to t=0.00132", "masticator 3D to t=1.1"]:
            touching, steps = found[name][5].split(",")[0], found[name][1].split()[0]
            self.assertIn(f"| {ratios[name]} | {touching} of {steps} |", findings)
        self.assertEqual(found["twisting-beam to t=0.2, tolerance 10"][5], "none")
        for name in ["masticator h=0.1", "ball-wall 3D to t=0.00132"]:
            self.assertIn(f"{1000 * float(found[name][2]):.0f} ms", text)

    def test_cook_with_quadratic_elements(self):
        with open(SOURCE / "verification/paper/cantilever/study.csv", newline="") as file:
            runs = {row["run"]: row for row in csv.DictReader(file)}
        exact = float(re.search(r"STORED_ENERGY = ([-\d.]+)", (SOURCE / "verification/cases/cook.py").read_text())[1])
        text = (SOURCE / "README.md").read_text().replace("\n", " ")
        off = lambda run: (float(runs[run]["potential"]) - exact) / 1000
        unknowns = lambda run: f"{float(runs[run]['unknowns']):,.0f} unknowns".replace(",", " ")
        self.assertIn(f"need {unknowns('uniform-3')} for {off('uniform-3'):.0f} kJ", text)
        self.assertIn(f"{unknowns('uniform-p2-0')} come within {off('uniform-p2-0'):.0f} kJ", text)
        # The study has the mean of all steps; tutorial_test.py runs it for the last one's.
        [remeshed] = re.findall(r"([\d ]+) unknowns reach ([\d.]+) kJ", text)
        self.assertGreater(int(remeshed[0].replace(" ", "")), float(runs["splits-p2-6.25"]["unknowns"]))
        self.assertEqual(remeshed[1], f"{off('splits-p2-6.25'):.1f}")


class Study(unittest.TestCase):
    def test_each_series_is_named(self):
        """docs/user-guide.md has the default series above those on request."""
        text = (SOURCE / "docs/user-guide.md").read_text()
        default, _, on_request = text.partition("### The runs of a study")[2].partition("\n### ")[0].partition("**More series**")
        series = re.findall(r'^ +\("([\w-]+)", "\w+", (True|False)', (SOURCE / "src/apps/study/plan.py").read_text(), re.MULTILINE)
        self.assertTrue(series)
        for name, is_default in series:
            self.assertIn(f"`{name}`", default if is_default == "True" else on_request)


class Refusals(unittest.TestCase):
    """docs/scenes.md, "Not there yet", has every key and combination that is refused; reference_test holds the page against the code."""

    def test_each_is_named(self):
        section = (SOURCE / "docs/scenes.md").read_text().partition("\n## Not there yet\n")[2].partition("\n## ")[0]
        named = set(re.findall(r"`([^`]+)`", section))
        keys = set(re.findall(r"^- `([^`]+)`", section.partition("\n### Keys with one value\n")[2], re.MULTILINE))
        rows = json.loads((SOURCE / "src/scene/keys.json").read_text())["keys"]
        self.assertEqual({row["keys"] for row in rows if row.get("role") in ("refused", "only")}, keys)
        places = re.findall(r'\{\{"([^"]+)",', (SOURCE / "src/simulation/unsupported.cpp").read_text())
        self.assertTrue(places)
        self.assertLessEqual(set(places), named)

    def test_rows_of_keys_have_columns_that_are_read(self):
        read = set(re.findall(r'(?:text|row\.value)\("(\w+)"', (SOURCE / "src/scene/key_table.cpp").read_text()))
        rows = json.loads((SOURCE / "src/scene/keys.json").read_text())["keys"]
        self.assertEqual({column for row in rows for column in row}, read)


class Embedding(unittest.TestCase):
    def test_what_was_renamed_has_another_name(self):
        section = (SOURCE / "docs/embedding.md").read_text().partition("\n## From 0.1 to 0.2\n")[2]
        rows = [re.findall(r"`(?:\w+::)?(\w+)`", cell) for line in section.splitlines() if line.startswith("| `")
                for cell in line.split("|")[1:3]]
        for before, after in zip(rows[::2], rows[1::2]):
            self.assertFalse(set(before) & set(after), before)


if __name__ == "__main__":
    unittest.main()
