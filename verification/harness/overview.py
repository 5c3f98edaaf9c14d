# SPDX-License-Identifier: MIT
"""What the first page of the report says beside its cases: the tables that other runs left, and how old all of it is."""
import csv
import datetime
import json

from harness import stored

VERIFICATION = stored.ROOT / "verification"


def rows(path):
    with open(VERIFICATION / path, newline="") as file:
        return list(csv.DictReader(file))


def table(what, title, page, files, judged):
    """`judged`: pairs of a row's name and why it failed, empty where it did not."""
    judged = list(judged)
    return {"what": what, "title": title, "page": page, "files": [f"verification/{file}" for file in files], "judged": len(judged),
            "passed": sum(not why for _, why in judged), "failures": [[name, why] for name, why in judged if why]}


def study_rows(path):
    content = json.loads(path.read_text())
    return [(f"{path.parent.name}, {run['run']}", "" if run["status"] == "finished" else run.get("reason", run["status"]))
            for run in content["runs"]]


def overview(never_run):
    """`never_run`: names of cases without a stored run."""
    studies = sorted((VERIFICATION / "paper").glob("*/study.json"))
    tables = [
        table("stability", "Hard cases", "stability/table.md", ["stability/results.csv"],
              ((row["case"], "" if row["passed"] == "True" else row["failures"]) for row in rows("stability/results.csv"))),
        table("paper", "The paper's scenes: finished, certified", "paper/README.md", ["paper/results.csv"],
              ((row["case"], "" if row["finished"] == row["certified"] == "True" else "not finished, or not certified")
               for row in rows("paper/results.csv"))),
        table("studies", "Speed against error of the paper's scenes: runs", "paper/studies.md",
              [str(path.relative_to(VERIFICATION)) for path in studies], (row for path in studies for row in study_rows(path))),
        table("needs", "Everything on against what a scene needs", "needs/table.md", ["needs/results.csv"],
              ((row["scene"], row["failure"]) for row in rows("needs/results.csv"))),
    ]
    return {"commit": stored.commit(), "date": datetime.date.today().isoformat(), "tables": tables,
            "never_run": never_run, "ages": [list(age) for age in stored.ages()]}
