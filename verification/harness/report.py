# SPDX-License-Identifier: MIT
"""The report of the suite as Markdown and HTML, from the same entries."""
import base64
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
    return ", ".join(filter(None, [entry["mode"], entry["date"], entry.get("versions", {}).get("itr", "").partition(" ")[0]]))


def age(changes):
    """Commits since to what a result depends on, in words."""
    return "unknown" if changes is None else "none" if changes == 0 else str(changes)


def failures(entries, overview):
    """What failed, a row each: results of cases, cases that broke, rows of the tables beside the report."""
    for name, entry in entries.items():
        for result in entry["results"]:
            if result["passed"] is False:
                yield [name, result["name"], f"{number(result['error'])}, at most {number(result['tolerance'])}"]
        if entry["status"] == "failed" and entry["message"]:
            yield [name, "did not run to its end", entry["message"].strip().splitlines()[-1]]
    for table in overview["tables"]:
        for what, why in table["failures"]:
            yield [table["what"], what, why]


def summary_rows(entries, overview):
    ages = {what.rpartition(" ")[2]: changes for what, _, changes in overview["ages"] if what.startswith("verification/report/")}
    for name, entry in entries.items():
        status = "**FAILED**" if entry["status"] == "failed" else entry["status"]
        yield [name, entry.get("title", ""), entry.get("reference", ""), status, counts(entry), run_of(entry), age(ages.get(name))]
    for table in overview["tables"]:
        made = [(commit, changes) for what, commit, changes in overview["ages"] if what in table["files"]]
        oldest = max((changes for _, changes in made if changes is not None), default=None)
        commits = sorted({commit for commit, _ in made})
        shown = ", ".join(commits) if len(commits) <= 3 else f"{len(commits)} commits"
        status = "**FAILED**" if table["failures"] else "passed"
        yield [table["what"], table["title"], table["page"], status, f"{table['passed']}/{table['judged']}", shown, age(oldest)]


SUMMARY_HEADER = ["what", "", "held against, or its page", "status", "results", "run", "commits to its code since"]


def page_one(entries, overview):
    """What was verified, what failed, how old it is."""
    judged = [result["passed"] for entry in entries.values() for result in entry["results"] if result["passed"] is not None]
    failed = list(failures(entries, overview))
    yield "p", (f"As of commit {overview['commit']}, {overview['date']}. {len(entries)} cases hold {len(judged)} results against FEniCSx, "
                f"closed forms, published benchmarks and peers: {sum(judged)} are within their tolerances. "
                f"{sum(t['passed'] for t in overview['tables'])} of {sum(t['judged'] for t in overview['tables'])} rows of the tables "
                "beside them pass. The last column counts commits to the code that a result depends on since it was made: results are "
                "only as good as that number is small.")
    if missing := overview["never_run"]:
        yield "p", f"Never run in full: {', '.join(missing)}."
    yield "h2", "What failed"
    if failed:
        yield "table", (["what", "which", "how"], failed)
    else:
        yield "p", "Nothing."
    yield "h2", "What was verified, and how old it is"
    yield "table", (SUMMARY_HEADER, list(summary_rows(entries, overview)))


def blocks(entries, overview):
    """The report as (kind, content) pairs, whatever it is written in."""
    yield "h1", "Verification report"
    yield from page_one(entries, overview)
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
    yield "p", "Written by `verification/run.py`; do not edit."


def markdown(content):
    def table(header, rows):
        cell = lambda text: str(text).replace("|", "\\|")
        lines = ["| " + " | ".join(map(cell, row)) + " |" for row in [header, ["---"] * len(header), *rows]]
        return "\n".join(lines)
    write = {"h1": lambda c: "# " + c, "h2": lambda c: "## " + c, "p": str, "pre": lambda c: f"```\n{c}\n```",
             "table": lambda c: table(*c), "image": lambda c: f"![{c}]({c})", "link": lambda c: f"[{c}]({c})"}
    return "\n\n".join(write[kind](body) for kind, body in content) + "\n"


STYLE = """body{font:15px/1.5 sans-serif;max-width:80em;margin:2em auto;padding:0 1em}table{border-collapse:collapse;margin:1em 0}
td,th{border:1px solid #ccc;padding:.2em .6em;text-align:left;vertical-align:top;overflow-wrap:break-word}th{background:#f2f2f2}
.bad{background:#fcc}img{max-width:100%}pre{background:#eee;overflow:auto}"""


def html_page(content, folder):
    """One file that needs nothing beside it: pictures are in it."""
    def table(header, rows):
        def cell(text, tag):
            bad = ' class="bad"' if text in ("**FAIL**", "**FAILED**") else ""
            return f"<{tag}{bad}>{html.escape(str(text).strip('*'))}</{tag}>"
        lines = ["".join(cell(text, "th") for text in header)] + ["".join(cell(text, "td") for text in row) for row in rows]
        return "<table>" + "\n".join(f"<tr>{line}</tr>" for line in lines) + "</table>"

    def picture(name):
        data = base64.b64encode((folder / name).read_bytes()).decode()
        return f'<p><img src="data:image/svg+xml;base64,{data}" alt="{name}"></p>'
    write = {"table": lambda c: table(*c), "image": picture, "link": lambda c: f'<p><a href="{c}">{c}</a></p>'}
    body = "\n".join(write[kind](part) if kind in write else f"<{kind}>{html.escape(part)}</{kind}>"
                     for kind, part in content)
    return ('<!doctype html><html lang="en"><meta charset="utf-8"><title>Verification report</title>'
            f"<style>{STYLE}</style>\n{body}\n</html>\n")


def write_report(folder, entries, overview):
    content = list(blocks(entries, overview))
    (folder / "report.md").write_text(markdown(content))
    (folder / "report.html").write_text(html_page(content, folder))
