# SPDX-License-Identifier: MIT
"""Cases, their results, and what a case may use while it runs."""
import dataclasses
import datetime
import importlib.util
import json
import math
import pathlib
import subprocess
import time
import traceback

VERIFICATION = pathlib.Path(__file__).resolve().parent.parent
ROOT = VERIFICATION.parent


@dataclasses.dataclass
class Result:
    """One line of a case: passed where `error` <= `tolerance` (a NaN fails). Without a tolerance it is shown, not judged."""
    name: str
    error: float
    tolerance: float | None
    value: object = None  # what we computed, where the error alone does not say it
    reference: object = None
    note: str = ""

    @property
    def passed(self):
        """None where it is not judged."""
        return None if self.tolerance is None else bool(self.error <= self.tolerance)

    def line(self):
        """As the terminal shows it."""
        verdict = {True: "ok  ", False: "FAIL", None: "    "}[self.passed]
        bound = "not judged" if self.passed is None else f"at most {self.tolerance:g}"
        return f"  {verdict} {self.name}: {self.error:.3g} ({bound})" + (f"  {self.note}" if self.note else "")


def excess(value, bound):
    """By how much a value is over its bound, 0 below. A NaN stays one, which Python's max(0.0, nan) would not."""
    return 0.0 if value <= bound else float(value - bound)


def compare(name, value, reference, tolerance, note=""):
    """The result of a number against its reference, by relative error."""
    return Result(name, abs(value - reference) / abs(reference), tolerance, value, reference, note)


class Failure(Exception):
    """A program that a case ran did not do what it was asked."""


class Skipped(Exception):
    """What a case needs is not on this machine; says what, and where it was looked for."""


@dataclasses.dataclass
class Context:
    """Where a case works: its own empty folder, the programs, where its pictures and tables go."""
    folder: pathlib.Path
    report: pathlib.Path
    build: pathlib.Path
    shared: pathlib.Path
    quick: bool
    case: str
    artifacts: list = dataclasses.field(default_factory=list)

    def data(self, path):
        """A file or folder of the shared data, which a machine need not have. Throws Skipped where it is not there."""
        found = self.shared / path
        if not found.exists():
            raise Skipped(f"{found} is not there (--shared)")
        return found

    def call(self, program, *arguments):
        """Runs a program of the build and returns what it printed. Throws Failure with its last words."""
        command = [str(self.build / "bin" / program), *map(str, arguments)]
        try:
            done = subprocess.run(command, capture_output=True, text=True, check=False)
        except FileNotFoundError as error:
            raise Failure(f"{command[0]} is not there: build it, or say --build") from error
        if done.returncode != 0:
            words = "\n".join((done.stdout + done.stderr).strip().splitlines()[-3:])
            raise Failure(f"{' '.join(command)}: exit status {done.returncode}\n{words}")
        return done.stdout

    def figure(self, name, draw, **size):
        """Draws with `draw(axes)` into an SVG of the report whose bytes depend on the data only."""
        import matplotlib
        matplotlib.use("Agg")
        matplotlib.rcParams["svg.hashsalt"] = "itr"
        import matplotlib.pyplot as pyplot
        figure, axes = pyplot.subplots(figsize=size.get("figsize", (6, 4)), constrained_layout=True)
        draw(axes)
        self.report.mkdir(parents=True, exist_ok=True)
        path = f"{self.case}-{name}.svg"
        figure.savefig(self.report / path, metadata={"Date": None})
        pyplot.close(figure)
        self.artifacts.append(path)

    def table(self, name, header, rows):
        """Writes a CSV of the report."""
        self.report.mkdir(parents=True, exist_ok=True)
        path = f"{self.case}-{name}.csv"
        lines = [",".join(map(str, row)) for row in [header, *rows]]
        (self.report / path).write_text("\n".join(lines) + "\n")
        self.artifacts.append(path)


def load_cases():
    """The modules of verification/cases in the order of their names."""
    cases = {}
    for path in sorted((VERIFICATION / "cases").glob("*.py")):
        spec = importlib.util.spec_from_file_location(f"cases.{path.stem}", path)
        module = importlib.util.module_from_spec(spec)
        module.needs = needs_of(path)
        module.loader = spec.loader
        cases[path.stem] = module
    return cases


def needs_of(path):
    """NEEDS of a case, without running it: what it needs may be what its first lines import."""
    for line in path.read_text().splitlines():
        if line.startswith("NEEDS = "):
            return line.removeprefix("NEEDS = ").strip("() \n").replace('"', "").replace(",", " ").split()
    return []


def missing_modules(case):
    return [name for name in case.needs if importlib.util.find_spec(name) is None]


def run_case(case, context):
    """One entry of the report."""
    entry = {"status": "failed", "results": [], "message": "", "mode": "quick" if context.quick else "full",
             "date": datetime.date.today().isoformat()}
    start = time.perf_counter()
    if missing := missing_modules(case):
        entry.update(status="skipped", message="not installed: " + ", ".join(missing))
        return entry
    try:
        case.loader.exec_module(case)
        entry.update({key: getattr(case, key.upper()) for key in ("title", "quantity", "reference")})
        entry["tolerance"] = str(case.TOLERANCE)
        if context.quick and not getattr(case, "QUICK", True):
            entry.update(status="skipped", message="not part of --quick")
            return entry
        for result in case.results(context):
            print(result.line(), flush=True)
            entry["results"].append({**dataclasses.asdict(result), "passed": result.passed})
        judged = [result["passed"] for result in entry["results"] if result["passed"] is not None]
        if not judged:
            entry["message"] = "the case gave no results"
        elif all(judged):
            entry["status"] = "passed"
    except Skipped as reason:
        failed = any(result["passed"] is False for result in entry["results"])  # what ran counts
        entry.update(status="failed" if failed else "skipped", message=("not all passed, then: " if failed else "") + str(reason))
    except Failure as error:
        entry["message"] = str(error)
    except Exception:  # a case that breaks is a case that fails; the others still run
        entry["message"] = traceback.format_exc()
    entry["seconds"] = round(time.perf_counter() - start, 1)
    entry["artifacts"] = context.artifacts
    return entry


def save_json(path, data):
    def plain(value):
        if isinstance(value, float) and not math.isfinite(value):
            return str(value)
        if hasattr(value, "tolist"):
            return value.tolist()
        raise TypeError(f"{type(value)} in a report")
    path.write_text(json.dumps(data, indent=1, default=plain, sort_keys=True) + "\n")
