# SPDX-License-Identifier: MIT
"""Newton iterations of bodies squeezed in contact, against the stored counts of verification/newton."""
import importlib.util

from harness.suite import VERIFICATION, Result

TITLE = "Newton iterations in hard contact"
QUANTITY = "counts missed of iterations, factorisations and the worst step; finished and certified"
REFERENCE = "verification/newton/squeeze.csv"
TOLERANCE = "15 % more iterations or factorisations, half as many again in the worst step"
NEEDS = ("numpy", "meshio")


def results(context):
    spec = importlib.util.spec_from_file_location("newton_squeeze", VERIFICATION / "newton/squeeze.py")
    squeeze = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(squeeze)
    context.data("paper-scenes")
    for row, missed in squeeze.check(context.build / "bin/itr", context.shared, large=not context.quick):
        counts = f"{row['iterations']} iterations, {row['factorizations']} factorisations, worst step {row['worst']}"
        yield Result(row["case"], len(missed), 0, row["energy"], note="; ".join([*missed, counts]))
