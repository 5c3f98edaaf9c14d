# SPDX-License-Identifier: MIT
"""Manufactured solutions: the loads that a given motion needs, as expressions of scene files, derived by sympy."""
import sympy
from sympy.printing.str import StrPrinter

X = sympy.symbols("x y z", real=True)
t = sympy.Symbol("t", real=True)


class Symbolic:
    """The operators of harness.materials for sympy matrices."""
    Identity = staticmethod(sympy.eye)
    det = staticmethod(lambda A: A.det(method="berkowitz"))
    tr = staticmethod(lambda A: A.trace())
    sym = staticmethod(lambda A: (A + A.T) / 2)
    inner = staticmethod(lambda A, B: sum(a * b for a, b in zip(A, B)))
    ln = staticmethod(sympy.log)
    sqrt = staticmethod(sympy.sqrt)

    @staticmethod
    def trace_of_stretch(F, dim, _):
        """In 3D for motions with a symmetric F only: there both the value and the derivative (R = I) are those of tr F."""
        return sympy.sqrt((F.T * F).trace() + 2 * F.det()) if dim == 2 else F.trace()


class ScenePrinter(StrPrinter):
    """Expressions as scene files have them: `ln`, and powers as a function, because there -a^b is (-a)^b."""

    def _print_Pow(self, power, rational=False):
        base = self._print(power.base)
        if power.exp.is_Integer and 0 < -power.exp <= 3:
            return "(1 / (" + " * ".join([f"({base})"] * int(-power.exp)) + "))"
        if power.exp.is_Integer and 0 < power.exp <= 3:
            return "(" + " * ".join([f"({base})"] * int(power.exp)) + ")"
        return f"pow({base}, {self._print(power.exp)})"

    def _print_Mul(self, product):
        return "(" + " * ".join(f"({self._print(factor)})" for factor in product.args) + ")"

    def _print_log(self, call):
        return f"ln({self._print(call.args[0])})"

    def _print_Rational(self, number):
        return repr(float(number))

    _print_Float = _print_Rational


def expression(value):
    """A sympy expression of x, y, z, t as a string of a scene."""
    return ScenePrinter().doprint(sympy.sympify(value))


def gradient(u):
    return sympy.Matrix(u).jacobian(X[:len(u)])


def stress(law, parameters, F):
    """First Piola-Kirchhoff stress of a law of harness.materials at the deformation gradient F (a matrix)."""
    dim = F.shape[0]
    G = sympy.Matrix(dim, dim, lambda i, j: sympy.Symbol(f"F{i}{j}"))
    energy = law(G, *(sympy.Float(p) for p in parameters), dim, Symbolic)
    at = {G[i, j]: F[i, j] for i in range(dim) for j in range(dim)}
    return energy.diff(G).subs(at) if hasattr(energy, "diff") else sympy.zeros(dim)


def divergence(P):
    dim = P.shape[0]
    return [sum(P[i, j].diff(X[j]) for j in range(dim)) for i in range(dim)]


def function_of_space(values, dim):
    """numpy: points (n x dim) -> n x shape of `values`, a list or a matrix of expressions."""
    import numpy as np
    matrix = sympy.Matrix(values)
    calls = [sympy.lambdify(X[:dim], entry, "numpy") for entry in matrix]
    shape = matrix.shape[:1] if matrix.shape[1] == 1 else matrix.shape

    def evaluate(points):
        columns = [np.broadcast_to(call(*points.T), len(points)) for call in calls]
        return np.stack(columns, axis=-1).reshape(len(points), *shape)
    return evaluate
