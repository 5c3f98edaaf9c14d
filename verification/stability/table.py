# SPDX-License-Identifier: MIT
"""Verdicts on hard cases, as a file and as a table."""
import csv
import dataclasses
import math


@dataclasses.dataclass
class Verdict:
    case: str
    passed: bool = False
    failures: str = ""
    dim: int = 2
    remeshed: bool = False
    steps: int = 0
    processor_seconds: float = math.nan
    min_distance: float = math.nan   # by the scene's size
    worst_volume: float = math.nan   # smallest volume by the rest volume, over cells and steps
    worst_quality: float = math.nan  # of the cells of the last frame, deformed; 1: regular
    vertices: int = 0
    energy_growth: float = math.nan
    balance: float = math.nan
    agreement: float = math.nan
    commit: str = ""


def number(value, form=".2g"):
    return "" if isinstance(value, float) and math.isnan(value) else format(value, form)


def table(rows):
    lines = ["| case | | passes | processor s | least distance / size | smallest volume / at rest | worst cell's quality | vertices | why not |",
             "|" + "---|" * 9]
    for r in rows:
        what = f"{r.dim}D" + (", remeshed" if r.remeshed else "")
        lines.append(f"| {r.case} | {what} | {'yes' if r.passed else '**no**'} | {number(r.processor_seconds)} | {number(r.min_distance)} "
                     f"| {number(r.worst_volume)} | {number(r.worst_quality)} | {r.vertices or ''} | {r.failures.replace('|', '/')} |")
    passed = sum(r.passed for r in rows)
    return f"{passed} of {len(rows)} pass.\n\n" + "\n".join(lines) + "\n"


def read(path):
    """Verdicts of a stored file."""
    def typed(field, text):
        return text == "True" if field.type is bool else field.type(text)
    with open(path, newline="") as file:
        return [Verdict(**{f.name: typed(f, row[f.name]) for f in dataclasses.fields(Verdict)}) for row in csv.DictReader(file)]


def write(folder, rows):
    with open(folder / "results.csv", "w", newline="") as file:
        writer = csv.DictWriter(file, [f.name for f in dataclasses.fields(Verdict)], lineterminator="\n")
        writer.writeheader()
        writer.writerows(dataclasses.asdict(row) for row in rows)
    (folder / "table.md").write_text(table(rows))
