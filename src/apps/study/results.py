# SPDX-License-Identifier: MIT
"""Results of a study: its runs, what each cost, and how far each is from the reference."""

import json
import re
import subprocess
import sys
from collections import Counter
from dataclasses import dataclass, field
from typing import Optional

from plan import REFERENCE, SECOND_REFERENCE, Run

FORM_OF_ERRORS = 4  # of what is kept in folders: changes with what errors have or mean

# Sizes of the scene that count as flight: a body in motion may well leave the place.
FLIGHT, FLIGHT_WITH_INERTIA = 1, 100

COSTS = {"processor_seconds": "processor seconds", "unknowns": "unknowns, mean over the steps", "memory_mb": "memory [MB]"}


@dataclass(frozen=True)
class Measure:
    """A kind of error, as `itr distance` names it."""

    name: str
    label: str
    unit: str = ""

    def show(self, error):
        if self.unit:
            return f"{error:.2g} {self.unit}"
        return f"{100 * error:.{2 if error < 1e-3 else 3}g} %"


L2, H1 = (Measure(name, f"{name.upper()} error of the displacement, relative") for name in ("l2", "h1"))
SURFACE = Measure("surface", "distance of the surfaces [m]", "m")
ENERGY = Measure("energy", "error of the energy [J]", "J")
MOMENTUM = Measure("momentum", "error of the momentum [kg m/s]", "kg m/s")
MEASURES = (L2, H1, SURFACE, ENERGY, MOMENTUM)
JUDGED = (L2, H1, ENERGY)  # the others are in tables and plots only


@dataclass
class Row:
    """One run: what it cost, and what its error is where it finished."""

    run: Run
    reason: str = ""  # why it did not finish; empty: it did
    certified: bool = False  # no frame with an inversion nor, where bodies touch, an intersection
    steps: int = 0
    unknowns: float = 0  # mean over the steps
    first_vertices: int = 0  # before the first step
    vertices: int = 0  # at the end
    seconds: float = 0  # of the steps, without output
    processor_seconds: float = 0  # the same, of all threads
    memory_mb: float = 0
    newton_iterations: int = 0
    potential: float = 0  # incremental potential of the last step [J]: in statics, less is nearer to the limit
    flight: float = 0  # largest mean displacement of a body, by the size of bodies and obstacles together
    warnings: Counter = field(default_factory=Counter)
    errors: Optional[dict] = None  # by measure, as `itr distance` prints them: None for what the frames do not tell

    @property
    def status(self):
        return "failed" if self.reason else "finished" if self.certified else "not certified"


@dataclass
class Results:
    scene: str  # path
    settings: str = ""  # what `--set` and `--solver` gave to all runs
    notes: str = ""  # what else holds for all runs
    version: str = ""
    reference: str = ""  # in words
    reference_run: str = ""  # its name; empty: it is none of the rows
    refused: str = ""  # why nothing is said against the reference; empty: it is said
    worth: Optional[dict] = None  # errors of a second reference against the first: smaller errors are not told
    second_reference: str = ""  # in words
    dim: int = 2
    frames: int = 0  # at most so many times are compared
    is_dynamic: bool = False
    has_friction: bool = False
    rows: list = field(default_factory=list)

    def find(self, name):
        """The row of a run that finished."""
        return next((row for row in self.rows if row.run.name == name and not row.reason), None)

    def told_error(self, row, measure):
        """An error that is not below the reference's own; None where it is, or where there is none."""
        error = row.errors and row.errors[measure.name]
        own = self.worth and self.worth[measure.name]
        has_bound = own is not None and row.run.reference == REFERENCE and row.run.name != SECOND_REFERENCE
        return None if error is None or (has_bound and error < own) else error

    def relative_error(self, row, measure):
        """Error as a fraction of the reference's size; None for measures without one."""
        error = self.told_error(row, measure)
        if error is None or measure in (L2, H1):
            return error
        size = row.errors["reference_energy"]
        return error / size if measure is ENERGY and size else None

    def flies(self, row):
        """Tells whether a body has left the scene: nothing holds it, as far as that can be seen."""
        return row.flight > (FLIGHT_WITH_INERTIA if self.is_dynamic else FLIGHT)


def fail(message, status=2):
    print(f"itr: {message}", file=sys.stderr)
    sys.exit(status)


def ask(*words, statuses=(0,)):
    """The JSON that a command prints; ends the study where the command says that something is wrong."""
    done = subprocess.run([str(word) for word in words], stdout=subprocess.PIPE)
    if done.returncode not in statuses:
        sys.exit(done.returncode if done.returncode > 0 else 3)
    return json.loads(done.stdout)


def read_row(itr, run, folder, log, has_contact):
    """Reads steps.jsonl and what the run printed, and certifies all frames: where nothing touches, bodies may pass through
    themselves."""
    first, *steps = (json.loads(line) for line in (folder / "steps.jsonl").read_text().splitlines())
    certificate = ask(itr, "certify", folder, "--json", statuses=(0, 4))
    return Row(
        run,
        certified=not any(has_contact or violation["of"] != "surfaces" for violation in certificate["violations"]),
        steps=len(steps),
        unknowns=sum(step["unknowns"] / len(steps) for step in steps),
        first_vertices=first["vertices"],
        vertices=steps[-1]["vertices"],
        seconds=sum(step["seconds"]["total"] - step["seconds"]["output"] for step in steps),
        processor_seconds=sum(step["processor_seconds"] for step in steps),
        memory_mb=max(step["peak_rss_mb"] for step in steps),
        newton_iterations=sum(step["newton_iterations"] for step in steps),
        potential=steps[-1]["energy"]["total"],
        flight=certificate["flight"],
        warnings=read_warnings(log.read_text(errors="replace")),
    )


def read_warnings(log):
    """How often a log has each warning; the same of many steps is one. A line counts once: a run that goes on, or is done
    already, says again what its scene gives cause to."""
    lines = dict.fromkeys(line for line in log.splitlines() if line.startswith("warning: "))
    return Counter(re.sub(r"^warning: (step \d+: )?", "", line) for line in lines)


def measure_errors(itr, folder, reference):
    """Errors of a run against another, which are kept in its folder until a frame of either changes."""
    stamps = [[f"{f.name} {f.stat().st_mtime_ns}" for f in sorted(one.glob("frames/*.h5"))] for one in (folder, reference)]
    key, file = [FORM_OF_ERRORS, *stamps], folder / "errors.json"
    kept = json.loads(file.read_text()) if file.exists() else {}
    if kept.get("of") != key:
        kept = {"of": key, "errors": ask(itr, "distance", folder, reference)}
        file.write_text(json.dumps(kept, indent=1) + "\n")
    return kept["errors"]
