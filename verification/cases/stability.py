# SPDX-License-Identifier: MIT
"""A few of the hard cases of verification/stability, one or two of each kind, that guard what was reached; all of them, with
those that fail, are run by its own run.py and stand in its table."""
import importlib.util
import pathlib

from harness.suite import Result

TITLE = "Hard cases"
QUANTITY = "whether a scene finishes, certified, with bounded energy and balanced forces, the same by two solvers and by two threads"
REFERENCE = "verification/stability"
TOLERANCE = "all of these"
NEEDS = ("meshio", "h5py")

NAMES = ("nu_0_4999", "coplanar_faces_remeshed", "stiff_on_soft_1e8", "heavy_on_light_1e4", "slivers_1e4_remeshed", "gap_1e_10", "collinear_edges",
         "dt_1_remeshed", "compressed_95", "far_1e6_remeshed", "points_2d", "storm_2d")


def results(context):
    path = pathlib.Path(__file__).resolve().parent.parent / "stability/run.py"
    spec = importlib.util.spec_from_file_location("stability_run", path)
    stability = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(stability)
    for name in NAMES:
        verdict, _, _ = stability.judge(name, context.build, context.folder)
        yield Result(name, 0.0 if verdict.passed else 1.0, 0.0, note=verdict.failures)
