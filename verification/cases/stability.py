# SPDX-License-Identifier: MIT
"""A few of the hard cases of verification/stability, one or two of each kind, that guard what was reached, and one that is known to
fail; all of them are run by its own run.py and stand in its table."""
import importlib.util
import pathlib

from harness.suite import Result

TITLE = "Hard cases"
QUANTITY = "whether a scene finishes, certified, with bounded energy and balanced forces, the same by two solvers and by two threads"
REFERENCE = "verification/stability"
TOLERANCE = "all of these, but for what hard_cases.py says to fail and why"
NEEDS = ("meshio", "h5py")

NAMES = ("nu_0_4999", "coplanar_faces", "coplanar_faces_remeshed", "stiff_on_soft_1e8", "heavy_on_light_1e4", "slivers_1e4_remeshed", "gap_1e_10", "collinear_edges",
         "dt_1_remeshed", "compressed_95", "far_1e6_remeshed", "points_2d", "storm_2d", "twist_10_turns_remeshed")


def results(context):
    path = pathlib.Path(__file__).resolve().parent.parent / "stability/run.py"
    spec = importlib.util.spec_from_file_location("stability_run", path)
    stability = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(stability)
    for name in NAMES:
        verdict, _, _ = stability.judge(name, context.build, context.folder)
        yield result_of(name, verdict, stability.cases.KNOWN)


def result_of(name, verdict, known):
    """A case that is known to fail is shown and not judged; one that is and passes fails here, to be taken off the list."""
    if name not in known:
        return Result(name, 0.0 if verdict.passed else 1.0, 0.0, note=verdict.failures)
    if verdict.passed:
        return Result(name, 1.0, 0.0, note="passes, and is among the KNOWN of hard_cases.py")
    return Result(name, 1.0, None, note=f"{verdict.failures}. Known: {known[name]}")
