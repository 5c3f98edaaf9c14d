# SPDX-License-Identifier: MIT
"""A material of ITR whose energy density is written in UFL and compiled by FFCx, for triangles or tetrahedra."""

import ctypes
import pathlib
import subprocess
import tempfile

import ffcx.codegeneration.jit
import numpy as np
import ufl

# Functions of itr_law over FFCx' kernels. Both take matrices by columns, as the UFL expressions are functions of F^T.
SHIM = """
#include <string.h>
typedef void (*kernel)(double*, const double*, const double*, const double*, const int*, const unsigned char*);
struct law { kernel density, stress, hessian; };
static const double cell[12] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1};
static void call(kernel k, double* values, int n, const double* F) {
  memset(values, 0, n * sizeof(double));
  k(values, F, 0, cell, 0, 0);
}
double density(int d, const double* F, struct law* law) { double W; call(law->density, &W, 1, F); return W; }
void stress(int d, const double* F, double* P, struct law* law) { call(law->stress, P, d * d, F); }
void hessian(int d, const double* F, double* H, struct law* law) { call(law->hessian, H, d * d * d * d, F); }
"""


class UflLaw:
    """Compiles density(F), a UFL expression of the deformation gradient: set(model, body) makes it the law of a body."""

    def __init__(self, density, dimension=2):
        cell = ufl.Cell("triangle" if dimension == 2 else "tetrahedron")
        domain = ufl.Mesh(ufl.VectorElement("Lagrange", cell, 1))
        constant = ufl.TensorElement("Discontinuous Lagrange", cell, 0, shape=(dimension, dimension))
        transposed = ufl.variable(ufl.Coefficient(ufl.FunctionSpace(domain, constant)))
        W = density(ufl.transpose(transposed))
        P = ufl.diff(W, transposed)
        middle = np.full((1, dimension), 1 / (dimension + 1))
        expressions = [(part, middle) for part in (W, P, ufl.diff(P, transposed))]
        with tempfile.TemporaryDirectory() as folder:
            compiled, self._module, _ = ffcx.codegeneration.jit.compile_expressions(expressions, cache_dir=folder)
            library = pathlib.Path(folder, "shim.so")
            subprocess.run(["cc", "-x", "c", "-O2", "-shared", "-fPIC", "-o", library, "-"], input=SHIM.encode(), check=True)
            shim = ctypes.CDLL(str(library))
        address = lambda kernel: int(self._module.ffi.cast("uintptr_t", kernel))
        self._kernels = (ctypes.c_void_p * 3)(*[address(part.tabulate_tensor_float64) for part in compiled])
        self._functions = [shim.density, shim.stress, shim.hessian]
        shim.density.restype = ctypes.c_double
        shim.density.law = self  # a simulation keeps the functions, and with them what they call
        self._dimension = dimension

    def set(self, model, body=0):
        model.set_law(body, *self._functions, user=ctypes.addressof(self._kernels))

    def evaluate(self, F):
        """W, P (d x d) and d2W/dF2 (d x d x d x d) at F (d x d), as ITR sees them."""
        d = self._dimension
        columns, P, H = np.asfortranarray(F, float), np.zeros((d, d), order="F"), np.zeros((d,) * 4, order="F")
        pointer = lambda array: ctypes.c_void_p(array.ctypes.data)
        arguments = [d, pointer(columns), ctypes.byref(self._kernels)]
        W = self._functions[0](*arguments)
        for function, values in zip(self._functions[1:], (P, H)):
            function(*arguments[:2], pointer(values), arguments[2])
        return W, P, H


def neo_hookean(E, nu, dimension=2):
    """ITR's NeoHookean, in 2D of plane stress."""
    mu = E / (2 * (1 + nu))
    lame = E * nu / (1 - nu**2) if dimension == 2 else E * nu / ((1 + nu) * (1 - 2 * nu))

    def density(F):
        log_J = ufl.ln(ufl.det(F))
        return mu / 2 * (ufl.tr(F.T * F) - dimension - 2 * log_J) + lame / 2 * log_J**2

    return density
