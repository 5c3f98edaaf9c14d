# SPDX-License-Identifier: MIT
"""What `itr fit` has to know of a law: which coefficients stresses are linear in, and where to begin with the others."""

import dataclasses
import itertools
from typing import Callable


@dataclasses.dataclass(frozen=True)
class Law:
    type: str
    num_linear: Callable  # (terms) -> number of coefficients that stresses are linear in
    coefficients: Callable  # (those, the others) -> keys of the material
    starts: Callable = lambda terms: [()]  # (terms) -> values of the others
    bounds: Callable = None  # (terms) -> lowest and highest ones
    is_positive: bool = False  # the linear coefficients have to be


def ogden(mus, alphas):
    """Each term with mu alpha > 0, which makes it stable: the linear coefficients are mu / alpha."""
    return {"mus": [m * a for m, a in zip(mus, alphas)], "alphas": alphas}


EXPONENTS = (1.3, 5.0, -2.0, 2.5, -5.0, 9.0)
LOWEST, HIGHEST = -12.0, 16.0

LAWS = {
    law.type: law
    for law in (
        Law("Yeoh", lambda terms: terms, lambda linear, _: {"C": linear}),
        Law("IsochoricMooneyRivlin", lambda _: 2, lambda linear, _: {"c1": linear[0], "c2": linear[1]}),
        Law("ArrudaBoyce", lambda _: 1, lambda linear, others: {"mu": linear[0], "lambda_m": others[0]},
            lambda _: [(1.5,), (3.0,), (6.0,)], lambda _: ([1.01], [50.0]), True),
        Law("Ogden", lambda terms: terms, ogden,
            lambda terms: list(itertools.combinations(EXPONENTS, terms)),
            lambda terms: ([LOWEST] * terms, [HIGHEST] * terms), True),
    )
}
