# SPDX-License-Identifier: MIT
"""The report of the suite as Markdown and HTML, from the same entries."""
import html
import math


VERDICT = {True: "ok", False: "**FAIL**", None: "not judged"}


def number(value):
    if isinstance(value, float):
        return f"{value:.6g}" if math.isfinite(value) else str(value)
    if isinstance(value, (list, tuple)):
        return "(" + ", ".join(number(v) for v in value) + ")"
    return "" if value is None else str(value)


def rows_of(entry):
    """Header and rows of a case's table; columns that no result fills are left out."""
    columns = [("quantity", "name"), ("value", "value"), ("reference", "reference"), ("error", "error"),
               ("tolerance", "tolerance"), ("note", "note")]
    used = [(title, key) for title, key in columns
            if any(result.get(key) not in (None, "") for result in entry["results"])]
    rows = [[number(result.get(key)) for _, key in used] + [VERDICT[result["passed"]]]
            for result in entry["results"]]
    return [title for title, _ in used] + [""], rows


def counts(entry):
    """Passed of judged."""
    judged = [result["passed"] for result in entry["results"] if result["passed"] is not None]
    return f"{sum(judged)}/{len(judged)}"


def run_of(entry):
    """When and of which commit; entries of before versions were stored with each have none."""
    return ", ".join(filter(None, [entry["mode"], entry["date"], entry.get("versions", {}).get("itr")]))


def summary_rows(entries):
    return [[name, entry.get("title", ""), entry["status"] if entry["status"] != "failed" else "**FAILED**", counts(entry),
             number(entry.get("seconds")), run_of(entry)] for name, entry in entries.items()]


SUMMARY_HEADER = ["case", "what", "status", "results", "seconds", "run"]


def blocks(entries):
    """The report as (kind, content) pairs, whatever it is written in."""
    yield "h1", "Verification report"
    yield "p", "Written by `verification/run.py`; do not edit."
    yield "table", (SUMMARY_HEADER, summary_rows(entries))
    for name, entry in entries.items():
        yield "h2", f"{name}: {entry.get('title', '')}"
        if "quantity" in entry:
            yield "p", f"Quantity: {entry['quantity']}. Reference: {entry['reference']}. Tolerance: {entry['tolerance']}."
        if versions := entry.get("versions"):
            yield "p", "Run with " + ", ".join(f"{name} {version}" for name, version in versions.items()) + "."
        if entry["message"]:
            yield "pre", entry["message"]
        if entry["results"]:
            yield "table", rows_of(entry)
        for artifact in entry.get("artifacts", []):
            yield ("image" if artifact.endswith(".svg") else "link"), artifact


def markdown(content):
    def table(header, rows):
        cell = lambda text: str(text).replace("|", "\\|")
        lines = ["| " + " | ".join(map(cell, row)) + " |" for row in [header, ["---"] * len(header), *rows]]
        return "\n".join(lines)
    write = {"h1": lambda c: "# " + c, "h2": lambda c: "## " + c, "p": str, "pre": lambda c: f"```\n{c}\n```",
             "table": lambda c: table(*c), "image": lambda c: f"![{c}]({c})", "link": lambda c: f"[{c}]({c})"}
    return "\n\n".join(write[kind](body) for kind, body in content) + "\n"


STYLE = """body{font:15px/1.5 sans-serif;max-width:70em;margin:2em auto;padding:0 1em}table{border-collapse:collapse}
td,th{border:1px solid #ccc;padding:.2em .6em;text-align:left}.bad{background:#fcc}img{max-width:100%}pre{background:#eee}"""


def html_page(content):
    def table(header, rows):
        def cell(text, tag):
            bad = ' class="bad"' if text in ("**FAIL**", "**FAILED**") else ""
            return f"<{tag}{bad}>{html.escape(str(text).strip('*'))}</{tag}>"
        lines = ["".join(cell(text, "th") for text in header)] + ["".join(cell(text, "td") for text in row) for row in rows]
        return "<table>" + "\n".join(f"<tr>{line}</tr>" for line in lines) + "</table>"
    write = {"table": lambda c: table(*c), "image": lambda c: f'<p><img src="{c}" alt="{c}"></p>',
             "link": lambda c: f'<p><a href="{c}">{c}</a></p>'}
    body = "\n".join(write[kind](part) if kind in write else f"<{kind}>{html.escape(part)}</{kind}>"
                     for kind, part in content)
    return f'<!doctype html><meta charset="utf-8"><title>Verification report</title><style>{STYLE}</style>\n{body}\n'


def write_report(folder, entries):
    content = list(blocks(entries))
    (folder / "report.md").write_text(markdown(content))
    (folder / "report.html").write_text(html_page(content))
