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


def worst(entry):
    """Error and tolerance of the judged result that comes nearest to its tolerance, or beyond it."""
    numbers = [(result["error"], result["tolerance"]) for result in entry["results"]
               if result["passed"] is not None and all(isinstance(result[key], (int, float)) for key in ("error", "tolerance"))]
    return max((pair for pair in numbers if pair[1] > 0), key=lambda pair: pair[0] / pair[1], default=(None, None))


def rounded(value):
    return "" if value is None else f"{value:.2g}"


def summary_rows(entries, overview):
    ages = {what.rpartition(" ")[2]: changes for what, _, changes in overview["ages"] if what.startswith("verification/report/")}
    for name, entry in entries.items():
        status = "**FAILED**" if entry["status"] == "failed" else f"{counts(entry)} {entry['status']}"
        yield [f"{name}: {entry.get('title', '')}", entry.get("reference", ""), status, *map(rounded, worst(entry)),
               run_of(entry), age(ages.get(name))]
    for table in overview["tables"]:
        made = [(commit, changes) for what, commit, changes in overview["ages"] if what in table["files"]]
        oldest = max((changes for _, changes in made if changes is not None), default=None)
        commits = sorted({commit for commit, _ in made})
        shown = ", ".join(commits) if len(commits) <= 3 else f"{len(commits)} commits"
        status = f"{table['passed']}/{table['judged']} " + ("**FAILED**" if table["failures"] else "passed")
        yield [f"{table['what']}: {table['title']}", table["page"], status, "", "", shown, age(oldest)]


SUMMARY_HEADER = ["case", "against", "results", "worst error", "its bar", "run", "commits since"]
MESSAGE = 200  # characters of a failure that the first page shows


def shortened(text):
    """The first part of a message; the page of its case has all of it."""
    first = text.split("; ")[0]
    return first if len(first) <= MESSAGE else first[:MESSAGE].rsplit(" ", 1)[0] + " ..."


def page_one(entries, overview):
    """What was verified, what failed, how old it is."""
    judged = [result["passed"] for entry in entries.values() for result in entry["results"] if result["passed"] is not None]
    rows, good = (sum(table[key] for table in overview["tables"]) for key in ("judged", "passed"))
    yield "p", (f"As of commit {overview['commit']}, {overview['date']}. {len(entries)} cases: {sum(judged)} of {len(judged)} results are "
                f"within their tolerances. {len(overview['tables'])} tables beside them: {good} of {rows} rows pass.")
    yield "table", (SUMMARY_HEADER, list(summary_rows(entries, overview)))
    yield "p", ("The worst error is that of the judged result which comes nearest to its bar. The last column counts commits, since the "
                "run, to the code that a result depends on. The smaller it is, the more the result says about the present code.")
    if missing := overview["never_run"]:
        yield "p", f"Cases that were never run in full: {', '.join(missing)}."
    yield "h2", "What failed"
    if failed := list(failures(entries, overview)):
        yield "table", (["case", "which", "how"], [[what, which, shortened(how)] for what, which, how in failed])
    else:
        yield "p", "Nothing."


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
