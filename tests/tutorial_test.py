#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Every command of docs/tutorial.md runs, the scenes it shows are the committed ones, and the forces it quotes come out to 1 %. The
decision that docs/theory.md works through and README's figure for quadratic elements come out too.

usage: tutorial_test.py ITR SOURCE_DIR
"""

import json
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

TOLERANCE = 0.01  # of a force; linear solvers and round-off change it by much less


def cook(command, source, folder, **sets):
    """The last step and the summary of Cook's membrane."""
    arguments = [text for pointer, value in sets.items() for text in ("--set", f"/{pointer}={value}")]
    subprocess.run([command, "run", source / "examples/cantilever.json", "-o", folder, "--overwrite", *arguments], check=True,
                   capture_output=True)
    return json.loads((folder / "steps.jsonl").read_text().splitlines()[-1]), json.loads((folder / "summary.json").read_text())


def decisions(command, source, folder):
    """Differences to the two tables of docs/theory.md, "One decision"."""
    page = (source / "docs/theory.md").read_text()
    rows = re.findall(r"^\| ([\d ]+) kJ \| (\d) \| (\d) \| (\d) \|", page, re.MULTILINE)
    if len(rows) != 5:
        yield f"docs/theory.md has {len(rows)} tolerances, not 5"
    for tolerance, *quoted in rows:
        step, _ = cook(command, source, folder, **{
            "geometry/0/n_refs": 1, "time/tend": 1, "time/dt": 1, "space/remesh/collapse/enabled": "false",
            "space/remesh/split/max_depth": 1, "space/remesh/split/acceptance_tolerance": tolerance.replace(" ", "") + "e3"})
        found = [str(step["splits"][key]) for key in ("tried", "relaxed", "accepted")]
        if found != quoted:
            yield f"docs/theory.md: {tolerance} kJ gives {found}, not {quoted}"
        if tolerance == "700" and not f"{round((step['energy_before_remesh'] - step['energy']['total']) / 1000):,} kJ".replace(",", " ") in page:
            yield "docs/theory.md quotes another gain of the whole mesh"


def quadratic(command, source, folder):
    """Differences to README's sentences on quadratic elements, on a fixed mesh and remeshed."""
    readme = (source / "README.md").read_text()
    exact = float(re.search(r"STORED_ENERGY = (-[\d.]+)", (source / "verification/cases/cook.py").read_text())[1])
    for words, sets in (("\n{} unknowns come within {:.0f} kJ", {"geometry/0/n_refs": 3, "space/remesh/enabled": "false"}),
                        ("too: {} unknowns reach {:.1f} kJ", {"space/remesh/split/acceptance_tolerance": 6.25,
                                                              "space/remesh/collapse/acceptance_tolerance": -6.25e-4})):
        last, _ = cook(command, source, folder, **{"space/discr_order": 2, **sets})
        unknowns, off = f"{last['unknowns']:,}".replace(",", " "), last["energy"]["total"] - exact
        if words.format(unknowns, off / 1000) not in readme:
            yield f"README: {unknowns} unknowns are {off:.0f} J off"


def main():
    command, source = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2])
    page = (source / "docs/tutorial.md").read_text()
    shown = [re.findall(rf"```{kind}\n(.*?)```", page, flags=re.DOTALL) for kind in ("bash", "json", "text")]
    commands, scenes, outputs = shown
    failures = [f"{name} is not what the page shows" for name, block in zip(["arch.json", "arch3d.json"], scenes)
                if block != (source / "examples/tutorial" / name).read_text()]
    with tempfile.TemporaryDirectory() as folder:
        failures += [*decisions(command, source, pathlib.Path(folder)), *quadratic(command, source, pathlib.Path(folder))]
    with tempfile.TemporaryDirectory() as folder:
        root = pathlib.Path(folder)
        shutil.copytree(source / "examples", root / "examples")
        (root / "build/release/bin").mkdir(parents=True)
        (root / "build/release/bin/itr").symlink_to(command)
        done = subprocess.run(["bash", "-euo", "pipefail", "-c", "\n".join(commands)], cwd=root, text=True, capture_output=True)
        if done.returncode:
            sys.exit(f"{done.stdout}\n{done.stderr}\nthe commands end with {done.returncode}")
    line = re.compile(r"^(\w+): ([\d.]+) N at 3 mm", re.MULTILINE)
    found = {name: float(force) for name, force in line.findall(done.stdout)}
    quoted = [pair for output in outputs for pair in line.findall(output)]
    failures += [f"{name}: the page says {force} N, the run {found.get(name)}" for name, force in quoted
                 if abs(found.get(name, 0) - float(force)) > TOLERANCE * float(force)]
    fixed = re.search(r"^quadratic: .*", page, re.MULTILINE)[0]  # of a mesh that nothing but n_refs changes
    if f"\n{fixed}\n" not in done.stdout:
        failures.append(f"the page says '{fixed}'")
    if len(quoted) < 6:
        failures.append("the page quotes fewer forces than it did")
    print("\n".join(failures) or f"{len(quoted)} forces as quoted")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
