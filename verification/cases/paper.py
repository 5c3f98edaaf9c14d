# SPDX-License-Identifier: MIT
"""The paper's scenes against their bars, by verification/paper/run.py."""
import importlib.util

from harness.suite import VERIFICATION, Result

TITLE = "Bars of the paper's scenes"
QUANTITY = "bars missed of gain, energy, vertices and processor time over another case's; finished and certified"
REFERENCE = "the reference implementation's gains; energies and vertices that were reached"
TOLERANCE = "none missed"
NEEDS = ()


def results(context):
    spec = importlib.util.spec_from_file_location("paper_run", VERIFICATION / "paper/run.py")
    paper = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(paper)
    context.data("paper-scenes")
    for row, missed in paper.check(context.build / "bin/itr", context.shared, context.folder):
        seconds = f"{row['processor_seconds_per_step']:.2g} s/step of the processor"
        yield Result(row["case"], len(missed), 0, row["energy_total"],
                     note="; ".join([*missed, f"gain {row['gain']:.4g} J, {row['vertices']} vertices, {seconds}"]))
