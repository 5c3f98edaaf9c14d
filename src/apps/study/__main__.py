# SPDX-License-Identifier: MIT
"""`itr study`: speed against error. Runs a scene on many meshes, each run in a process of its own, goes on where an earlier
study was stopped, and writes study.{csv,json,md,svg}. The first argument is the command `itr`, the others are the study's."""

import argparse
import ctypes
import os
import pathlib
import signal
import subprocess
import sys

from answers import Answers
from plan import ALL_SERIES, REFERENCE, SECOND_REFERENCE, Plan
from results import Row, ask, fail, measure_errors, read_row

STOPPED = 3  # exit status
LEAST_SPLIT = 0.01  # of its uniform level's vertices that a reference has to add
SAME = 1e-9  # relative errors below it are of one and the same solution
GRACE = 20  # for a run to finish a step and to save it [s]
PR_SET_PDEATHSIG = 1  # of prctl(2)
LIBC = ctypes.CDLL(None)


def listed(convert):
    return lambda text: [convert(word) for word in text.split(",")]


def read_options(words):
    parser = argparse.ArgumentParser("itr study", formatter_class=argparse.RawTextHelpFormatter, allow_abbrev=False)
    parser.description, add = "speed against error: runs a scene on many meshes and says which to take", parser.add_argument
    names = "".join(f"\n  {s.name}{'' if s.is_default else ' (not by default)'}: {s.what}" for s in ALL_SERIES.values())
    second = "folder of another that tells what the first is worth (default: unknown with --reference, else a run)"
    add("scene", help="scene file (JSON)")
    add("-o", "--output", help="folder (default: study/<scene>); what is done in it is not done again")
    add("--series", type=listed(str), default=[], help="some of these, or `all`:" + names)
    add("--levels", type=int, help="uniform refinements of the scene's mesh (default: 3 in 2D, 2 in 3D)")
    add("--tolerances", type=listed(float), help="of splits [J] (default: 4, 1, 1/4 and 1/16 times the scene's)")
    add("--starts", type=listed(int), default=[0], help="uniform refinements before remeshing begins (default: 0)")
    add("--reference", help="folder of a run to compare with (default: the finest level, split on and never coarsened)")
    add("--second-reference", help=second)
    add("--reference-tolerance", type=float, help="of its splits [J] (default: a sixteenth of the smallest tolerance)")
    add("--frames", type=int, default=10, help="times at which runs are compared (default: 10)")
    add("--time-limit", type=float, default=0, help="of a run [s]")
    add("--solver", default="", help="linear solver, see `itr solvers`")
    add("--threads", type=int, default=1, help="of each run (default: 1)")
    add("--set", action="append", default=[], help="/json/pointer=VALUE, for all runs")
    add("--defaults", help="what keys that the scene leaves out stand for: itr (default) or polyfem, see docs/scenes.md")
    options = parser.parse_args(words)
    if options.defaults:
        options.set.append(f'/defaults="{options.defaults}"')
    for name, least in (("levels", 1), ("frames", 1), ("threads", 1), ("starts", 0), ("time_limit", 0), ("tolerances", 1e-300),
                        ("reference_tolerance", 1e-300)):
        values = getattr(options, name)
        if values is not None and min([values] if isinstance(values, (int, float)) else values) < least:
            parser.error(f"--{name.replace('_', '-')}: found {values}; expected {'more' if least else 'nothing less'} than 0")
    known = ["all", *ALL_SERIES]
    for name in (name for name in options.series if name not in known):
        fail(f'--series: found "{name}"; expected some of {", ".join(known)}')
    options.output = pathlib.Path(options.output or pathlib.Path("study", pathlib.Path(options.scene).stem))
    return options


def words_of_sets(sets):
    return [word for text in sets for word in ("--set", text)]


class Study:
    def __init__(self, itr, options):
        self.itr, self.options, self.is_interrupted, self.process = itr, options, False, None
        facts = ask(itr, "explain", options.scene, "--json", *words_of_sets(options.set))
        if facts["time"]["dt"] == "auto":
            fail(f"{options.scene}: /time/dt: found \"auto\", expected a number: runs are compared step by step")
        settings = [f"`{text}`" for text in options.set] + ([f"solver `{options.solver}`"] if options.solver else [])
        options.sets = dict(text.split("=", 1) for text in options.set)
        self.plan, self.has_contact = Plan(options, facts), facts["contact"]
        self.reference = ""  # name of its run
        self.results = Answers(options.scene, ", ".join(settings), self.plan.notes, facts["version"], frames=options.frames)
        self.results.dim, self.results.has_friction = facts["dim"], facts["friction"]
        self.results.is_dynamic = not facts["time"]["static"] and not facts["time"]["quasistatic"]

    def run(self):
        for name in (signal.SIGINT, signal.SIGTERM):
            signal.signal(name, self.interrupt)
        self.folder_of("").mkdir(parents=True, exist_ok=True)
        self.find_reference()
        for planned in self.plan.runs:
            self.add(planned)
        for row in self.results.rows:
            self.measure(row)  # what waited for the run that it is compared with
        self.judge_reference()
        from report import write_files

        page, folder = write_files(self.results, self.options.output), self.options.output
        print(f"{page}\nThis page, study.csv, study.json and study.svg are in {folder}; `itr report {folder}` shows them in a browser")
        return STOPPED if all(row.reason for row in self.results.rows) else 0

    def interrupt(self, *_):
        self.is_interrupted = True
        if self.process:
            self.process.terminate()

    def folder_of(self, name):
        return self.options.output / "runs" / name

    def add(self, planned):
        row = self.run_one(planned)
        self.results.rows.append(row)
        self.measure(row)
        text = row.reason or f"{row.processor_seconds:.3g} processor s, {row.vertices} vertices, {row.memory_mb:.0f} MB"
        if row.errors:
            text += f"; L2 {row.errors['l2']:.2e}, H1 {row.errors['h1']:.2e}"
        count = len(self.plan.runs) + bool(self.plan.references)
        print(f"[{len(self.results.rows)}/{count}] {planned.name}: {text}", file=sys.stderr, flush=True)
        return row

    def find_reference(self):
        """Runs references until one splits: one that does not is its uniform level, and against that nothing would be told."""
        for planned in self.plan.references:
            self.results.rows.clear()
            row, self.reference = self.add(planned), planned.name
            if row.reason or row.vertices > (1 + LEAST_SPLIT) * row.first_vertices:
                return
            print(f"{planned.name} splits nothing: {row.vertices} vertices, as its uniform level", file=sys.stderr)
        if self.plan.references:
            fail(
                f"{self.options.scene}: --reference-tolerance: found a reference that is its uniform level: {row.vertices} "
                f"vertices, {row.vertices - row.first_vertices} of them by splits ({row.run.label}); expected a smaller "
                "tolerance, or --reference DIR"
            )

    def run_one(self, planned):
        folder, log = self.folder_of(planned.name), self.folder_of(f"{planned.name}.log")
        words = ["run", self.options.scene, "-o", str(folder), "--threads", str(self.options.threads), "--resume"]
        words += ["--solver", planned.solver] if planned.solver else []
        words += words_of_sets(f"{pointer}={value}" for pointer, value in planned.settings.items())
        reason = self.call([self.itr, *words], log)
        if self.is_interrupted:
            fail(f"interrupted in {planned.name}; the same command goes on from there", STOPPED)
        return Row(planned, reason) if reason else read_row(self.itr, planned, folder, log, self.has_contact)

    def call(self, words, log):
        """Runs a command, which is told to end where it takes too long. Returns why it did not finish."""
        parent, limit, is_late = os.getpid(), self.options.time_limit, False

        def end_with_parent():
            LIBC.prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
            if os.getppid() != parent:  # it ended before that took hold
                os._exit(1)

        with open(log, "ab") as output:
            self.process = subprocess.Popen(words, stdout=output, stderr=output, preexec_fn=end_with_parent)
        for seconds, end in ((limit, self.process.terminate), (GRACE, self.process.kill)) if limit else ():
            try:
                self.process.wait(seconds)
            except subprocess.TimeoutExpired:
                is_late = True
                end()
        if self.is_interrupted:  # perhaps before there was a process
            self.process.terminate()
        status = self.process.wait()
        if is_late and status:
            return f"took longer than {limit:g} s"
        if status < 0:
            return f"ended by signal {-status}"
        _, _, message = ("\n" + log.read_text(errors="replace")).rpartition("\nitr: ")
        return status and (message.strip() or f"ended with status {status}")

    def reference_of(self, row):
        """The folder that a run is compared with; None: none, or none yet."""
        name = row.run.reference
        if name == REFERENCE and self.options.reference:
            folder = pathlib.Path(self.options.reference)
            return None if folder.exists() and folder.samefile(self.folder_of(row.run.name)) else folder
        if name == REFERENCE:
            name = self.reference if self.results.find(self.reference) else self.plan.finest
        return self.folder_of(name) if name != row.run.name and self.results.find(name) else None

    def measure(self, row):
        reference = row.run.reference and not row.reason and not row.errors and self.reference_of(row)
        if reference:
            row.errors = measure_errors(self.itr, self.folder_of(row.run.name), reference)

    def judge_reference(self):
        """Judges the reference's own error, and whether it is a reference at all."""
        results, options, plan = self.results, self.options, self.plan
        finest, reference, second = map(results.find, (plan.finest, self.reference, SECOND_REFERENCE))
        if not second and not options.reference and not reference:
            second = results.find(plan.coarser)
        if options.second_reference and options.reference:
            results.worth = measure_errors(self.itr, pathlib.Path(options.second_reference), pathlib.Path(options.reference))
            results.second_reference = f"the run in `{options.second_reference}`"
        elif second and second.errors:
            results.worth = second.errors
            results.second_reference = f"`{second.run.name}` ({second.run.label}: {second.vertices} vertices)"

        if finest and finest.errors and max(finest.errors["l2"], finest.errors["h1"]) < SAME:
            results.refused = f"it equals the finest uniform level, `{plan.finest}`"
        elif reference and results.flies(reference):
            results.refused = "a body flies away in it"
        elif reference and not reference.certified:
            results.refused = "a frame of it has an intersection or an inversion"
        if results.refused:
            results.worth = None
            for row in results.rows:
                row.errors = None if row.run.reference == REFERENCE else row.errors

        results.reference = f"the run in `{options.reference}`" if options.reference else "nothing"
        if row := not options.reference and (reference or finest):
            results.reference_run = row.run.name
            end = f"{row.vertices} vertices, potential {row.potential:.8g} J in the last step"
            results.reference = f"`{row.run.name}` ({row.run.label}: {end})"


def main():
    options = read_options(sys.argv[2:])
    try:
        import matplotlib  # noqa: F401
    except ImportError as error:
        fail(f"study: found Python without matplotlib ({error}); expected it: apt install python3-matplotlib")
    try:
        return Study(sys.argv[1], options).run()
    except OSError as error:
        fail(f"{error.filename}: found {error.strerror}; expected files and folders that can be used")


if __name__ == "__main__":
    sys.exit(main())
