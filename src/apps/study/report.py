# SPDX-License-Identifier: MIT
"""Writes the results of a study: its rows as CSV and JSON, and a page in Markdown."""

import csv
import io
import json

from results import MEASURES

# Columns with their formats.
NUMBERS = {"steps": "", "vertices": "", "unknowns": ".7g", "seconds": ".4g", "processor_seconds": ".4g", "memory_mb": ".4g"}
NUMBERS |= {"newton_iterations": "", "potential": ".12g"}


def make_csv(results):
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["run", "series", "label", "status", "reason", *NUMBERS, *(measure.name for measure in MEASURES)])
    for row in results.rows:
        numbers = ["" if row.reason else format(getattr(row, key), digits) for key, digits in NUMBERS.items()]
        told = [results.told_error(row, measure) for measure in MEASURES]
        errors = ["" if error is None else f"{error:.6g}" for error in told]
        writer.writerow([row.run.name, row.run.series.name, row.run.label, row.status, row.reason, *numbers, *errors])
    return text.getvalue()


def row_json(results, row):
    run, sets = row.run, [f"{pointer}={value}" for pointer, value in row.run.settings.items()]
    found = {"run": run.name, "series": run.series.name, "label": run.label, "set": sets, "solver": run.solver}
    found["status"] = row.status
    if row.reason:
        return found | {"reason": row.reason}
    found |= {key: getattr(row, key) for key in (*NUMBERS, "flight")}
    found["warnings"] = [{"text": text, "times": times} for text, times in row.warnings.items()]
    if not row.errors:
        return found
    return found | {"against": run.reference, "errors": {m.name: results.told_error(row, m) for m in MEASURES}}


def make_json(results):
    keys = ("scene", "settings", "notes", "version", "reference", "refused", "second_reference")
    content = {key: getattr(results, key) for key in keys} | {"refused": results.refused or None}
    content["worth"] = results.worth and {measure.name: results.worth[measure.name] for measure in MEASURES}
    content |= {"times": results.frames, "doubts": [*results.doubts()], "answers": [*results.answers()]}
    content |= {"verdicts": results.verdicts, "orders": results.orders, "runs": [row_json(results, row) for row in results.rows]}
    return json.dumps(content, indent=1, ensure_ascii=False) + "\n"


def table(head, rows):
    """A table in Markdown."""
    lines = ([str(cell).replace("|", "\\|").replace("\n", " ") for cell in line] for line in rows)
    return "".join(f"| {' | '.join(line)} |\n" for line in (head, ["---"] * len(head), *lines))


def choices_text(results):
    """The runs to take, and the command of each; empty where nothing is recommended."""
    head = ["error", "at most", "run", "vertices", "processor s", "that of uniform refinement, between its levels", "MB"]
    rows, commands = [], {}
    for measure, target, point, cost in results.choices():
        row, run = point.row, point.row.run
        uniform = "not reached" if cost is None else f"{cost:.3g}"
        of_run = [f"`{run.name}`", row.vertices, f"{point.cost:.3g}", uniform, f"{row.memory_mb:.0f}"]
        rows.append([measure.name, measure.show(target), *of_run])
        sets = "".join(f" --set '{key}={value}'" for key, value in run.settings.items() if not key.startswith("/output"))
        solver = f" --solver {run.solver}" if run.solver else ""
        commands[run.name] = f"- `{run.name}`: `itr run {results.scene}{sets}{solver}`\n"
    return rows and f"\n## For this error, run this\n\n{table(head, rows)}\n{''.join(commands.values())}"


def error_cell(results, row, measure):
    """Errors below the reference's own are bounds."""
    if not row.errors or row.errors[measure.name] is None:
        return ""
    error = results.told_error(row, measure)
    return f"below {results.worth[measure.name]:.2g}" if error is None else f"{error:.3g}"


def runs_table(results):
    measures = [f"{measure.name} {measure.unit}".strip() for measure in MEASURES]
    rows = []
    for row in results.rows:
        cells = [f"failed: {row.reason}"]
        if not row.reason:
            cells = [row.vertices, f"{row.unknowns:.0f}", f"{row.processor_seconds:.3g}", f"{row.seconds:.3g}"]
            cells += [f"{row.memory_mb:.0f}", *(error_cell(results, row, m) for m in MEASURES), f"{row.potential:.8g}"]
        rows.append([row.run.name, row.run.label, *cells])
    head = ["run", "", "vertices", "unknowns, mean", "processor s", "s", "MB", *measures, "last potential J"]
    return table(head, rows)


def warnings_text(results):
    """Each warning once, with the runs that gave it."""
    runs = {}
    for row in results.rows:
        for text, times in row.warnings.items():
            runs.setdefault(text, []).append(f"`{row.run.name}`" + (f" ({times} times)" if times > 1 else ""))
    lines = "".join(f"- {text}: {', '.join(names)}\n" for text, names in runs.items())
    return lines and "\n## Warnings of the runs\n\n" + lines


def make_page(results):
    """A page in Markdown: doubts and answers first, then orders, all runs, and the warnings that they gave."""
    settings = f"With {results.settings}. " if results.settings else ""
    notes = f"In all runs {results.notes}. " if results.notes else ""
    fitted = ([*o.values()][:2] + [f"{o['in_size']:.2f}", f"{o['in_seconds']:.2f}", o["runs"]] for o in results.orders)
    parts = (
        f"# Speed against error: {results.scene}\n\n{settings}{notes}Errors against {results.reference}, over at most "
        f"{results.frames} times.\n\n",
        *(f"- {sentence}\n" for sentence in (*results.doubts(), *results.answers())),
        choices_text(results) or "",
        "\n## Orders\n\nError by element size (unknowns to the power of -1/Dim) and by processor seconds, fitted.\n\n",
        table(["series", "error", "by size", "by seconds", "runs"], fitted),
        f"\n## Runs\n\n{runs_table(results)}{warnings_text(results)}\n![work and precision](study.svg)\n",
    )
    return "".join(parts)


def write_files(results, folder):
    """Writes study.{csv,json,md,svg}. Returns the page."""
    from plot import make_svg  # which needs matplotlib

    page = make_page(results)
    (folder / "study.csv").write_text(make_csv(results))
    (folder / "study.json").write_text(make_json(results))
    (folder / "study.md").write_text(page)
    (folder / "study.svg").write_text(make_svg(results))
    return page
