# SPDX-License-Identifier: MIT
"""ITR: contacting elastodynamics on a mesh that is refined and coarsened inside each time step.

>>> model = itr.Model(vertices, cells)
>>> model.add_boundary("left", box=([0, 0], [0, 1]))
>>> model.set_options({"materials": {"type": "NeoHookean", "E": 1e5, "nu": 0.3, "rho": 1000}, "time": {"dt": 0.01, "tend": 1}})
>>> simulation = itr.Simulation(model)
>>> simulation.fix("left", [0, 0])
>>> simulation.step()

Arrays are NumPy's: points of shape (n, d), cells (m, d + 1), SI units, ids from 0. `InputError`, a ValueError, says which
array, which index, what was found and what was expected.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Callable, Iterable, Mapping, Optional, Sequence, Union

import numpy as np

from . import _itr
from ._itr import InputError, Saved, __version__
from ._study import study

if TYPE_CHECKING:
    import dolfinx.fem
    import dolfinx.mesh
    import meshio
    import scipy.sparse

__all__ = ["Cancelled", "InputError", "MeshChange", "Model", "Saved", "Simulation", "StepFailed", "__version__", "study"]

Array = np.ndarray
Value = Union[float, Sequence[float], Array, Callable[[Array, float], Array]]
"""A constant (d numbers; a pressure: one), values by vertex of the present mesh (n x d; n), or a function of the rest positions
(n x d) and the time at the end of a step, which is called once before each step."""
Compiled = Any
"""A function of C's calling convention: of a ctypes library, of numba.cfunc, or an address. A step calls it without Python's
lock, from several threads."""

FORCES = ("contact", "friction", "reaction", "applied")


class StepFailed(RuntimeError):
    """A step could not be done; the state is that before it."""


class Cancelled(StepFailed):
    """A listener of Newton iterations ended the step; the state is that before it."""


class Model:
    """What is simulated. Simulations copy it."""

    def __init__(self, vertices: Array, cells: Array, bodies: Optional[Array] = None):
        """`vertices`: (n, d) [m], d = 2 or 3; `cells`: (m, d + 1), positive volumes; `bodies`: an id a cell, else all 0."""
        vertices = np.asarray(vertices, dtype=float)
        if vertices.ndim != 2:
            raise InputError(f"vertices: found an array of shape {vertices.shape}; expected (n, 2) or (n, 3)")
        self._model = _itr.Model(vertices.shape[1])
        self._kept: list = []  # what compiled functions live in
        self._model.set_mesh(vertices, _ints("cells", cells), _ints("bodies", [] if bodies is None else bodies))

    @classmethod
    def from_scene(cls, file: str, overrides: Optional[Mapping[str, Any]] = None) -> "Model":
        """All of a scene file; `overrides`: values by JSON pointer. Its surfaces are boundaries "1", "2", ...: their ids."""
        model = cls.__new__(cls)
        model._model = _itr.Model.from_scene(str(file), dict(overrides or {}))
        model._kept = []
        return model

    @classmethod
    def from_meshio(cls, mesh: meshio.Mesh) -> Model:
        """The tetrahedra of a meshio.Mesh, or else its triangles, in the plane z = 0. Gmsh's physical groups are bodies (their
        numbers) and, of facets, boundaries (their names, or else numbers)."""
        from ._convert import from_meshio

        vertices, cells, bodies, boundaries = from_meshio(mesh)
        model = cls(vertices, cells, bodies)
        for name, facets in boundaries.items():
            model.add_boundary(name, facets)
        return model

    @property
    def dimension(self) -> int:
        return self._model.dimension

    def set_options(self, options: Mapping[str, Any]) -> None:
        """Keys of a scene file but for geometry and output, merged into what was given before."""
        self._model.set_options(dict(options))

    def set_option(self, pointer: str, value: Any) -> None:
        """One of them: set_option("/time/dt", 0.01)."""
        self._model.set_option(pointer, value)

    def add_boundary(
        self,
        name: str,
        facets: Optional[Array] = None,
        box: Optional[tuple[Sequence[float], Sequence[float]]] = None,
        where: Optional[Callable[[Array], bool]] = None,
    ) -> int:
        """Names facets of the boundary: by their vertices (k, d), as those in a box (low, high), or as those whose middle X
        `where` takes. Returns the id that options know it by."""
        if (facets is not None) + (box is not None) + (where is not None) != 1:
            raise InputError(f"boundary '{name}': expected one of facets, box and where")
        if facets is not None:
            return self._model.add_boundary_facets(name, _ints(f"boundary '{name}'", facets))
        if box is not None:
            return self._model.add_boundary_box(name, box[0], box[1])
        return self._model.add_boundary_rule(name, where)

    def add_obstacle(self, name: str, vertices: Array, edges: Array = (), triangles: Array = ()) -> int:
        """Geometry that only collides. Returns the id that options know it by."""
        return self._model.add_obstacle(name, vertices, _ints("edges", edges), _ints("triangles", triangles))

    def set_law(self, body: int, density: Compiled, stress: Compiled, hessian: Compiled, user: int = 0) -> None:
        """A stored-energy density of the program's own, of the functions of `itr_law` in itr.h, for a body that the options
        give a material: its E, nu (a scale) and density stay. `user` is the address that the functions get."""
        self._kept += [density, stress, hessian]
        self._model.set_law(body, _address(density), _address(stress), _address(hessian), user)


class MeshChange:
    """The change of a mesh within a step; projection only during the call that is told of it.

    `vertex`, `cell`, `facet`: the new id by old one, -1 where it is gone. `facet_parent`: by new facet, the old one on which
    its middle lies.
    """

    def __init__(self, data: Mapping[str, Any]):
        self.vertex: Array = data["vertex"]
        self.cell: Array = data["cell"]
        self.facet: Array = data["facet"]
        self.facet_parent: Array = data["facet_parent"]
        self._data = data

    def interpolation(self) -> scipy.sparse.csr_matrix:
        """The transfer operator, a scipy.sparse.csr_matrix (new vertices x old ones): `P @ field`."""
        from scipy.sparse import csr_matrix

        return csr_matrix((self._data["data"], self._data["indices"], self._data["indptr"]), shape=self._data["shape"])

    def interpolate(self, field: Array) -> Array:
        """The same without SciPy: values at the new vertices of a field (n,) or (n, k)."""
        field = np.asarray(field, dtype=float)
        rows = np.repeat(np.arange(self._data["shape"][0]), np.diff(self._data["indptr"]))
        result = np.zeros((self._data["shape"][0],) + field.shape[1:])
        weights = self._data["data"].reshape((-1,) + (1,) * (field.ndim - 1))
        np.add.at(result, rows, weights * field[self._data["indices"]])
        return result

    def project(self, field: Array) -> Array:
        """The L2 projection, which keeps integrals."""
        field = np.asarray(field, dtype=float)
        return self._data["project"](field.reshape(len(field), -1)).reshape((-1,) + field.shape[1:])


class Simulation:
    """A simulation that goes on step by step. It copies the model; two of them do not disturb each other."""

    def __init__(self, model: Model, log: Optional[Callable[[int, str], None]] = None):
        """`log` gets messages with their level: 0 debug, 1 information, 2 warning."""
        self._simulation = _itr.Simulation(model._model, log)
        self._functions: dict[tuple, Callable[[float], None]] = {}
        self._kept = {"laws": list(model._kept)}  # what compiled functions live in

    # Steps.

    def step(self, dt: Optional[float] = None) -> dict:
        """One step of the length dt [s], else as the one before or as the options say. Returns `report`. Raises StepFailed."""
        self._do(self._simulation.step, dt)
        return self.report

    def adapt(self, dt: Optional[float] = None) -> None:
        """Finds the mesh of the next step and stays at its start, on that mesh: before sub-iterations on a frozen one."""
        self._do(self._simulation.adapt, self._simulation.step_length if dt is None else dt)

    def _do(self, step: Callable[[float], tuple], dt: Optional[float]) -> None:
        if dt is not None and not dt > 0:
            raise InputError(f"dt: found {dt:g}; expected a number > 0")
        t = self.time + (self._simulation.step_length if dt is None else dt)
        for sample in self._functions.values():
            sample(t)
        ok, cancelled, reason = step(dt or 0.0)
        if not ok:
            raise (Cancelled if cancelled else StepFailed)(reason)

    @property
    def time(self) -> float:
        """[s]"""
        return self._simulation.time

    @property
    def steps(self) -> int:
        """How many were done."""
        return self._simulation.steps

    @property
    def finished(self) -> bool:
        """Whether as many steps were done as the options ask for."""
        return self._simulation.finished

    @property
    def report(self) -> dict:
        """Of the last step, or of the start: sizes, iterations, operations, energies [J]."""
        return self._simulation.report

    @property
    def warnings(self) -> list[str]:
        """What is legal but suspicious in the options."""
        return self._simulation.warnings

    # What acts from the next step on.

    def fix(self, boundary: str, displacement: Value, mask: Optional[Sequence[bool]] = None) -> None:
        """Prescribes displacements from rest [m], of the components in `mask` only; release() takes that back."""
        flags = np.ones(self.dimension, int) if mask is None else np.asarray(mask, int)
        self._set(("fix", boundary), displacement, lambda values: self._simulation.fix(boundary, flags, values))

    def release(self, boundary: str) -> None:
        self._functions.pop(("fix", boundary), None)
        self._simulation.fix(boundary, np.zeros(self.dimension, int), np.zeros(self.dimension))

    def set_traction(self, boundary: str, traction: Value) -> None:
        """Force by rest area [N/m^2] (2D: length [N/m])."""
        self._set(("traction", boundary), traction, lambda values: self._simulation.set_traction(boundary, values))

    def set_pressure(self, boundary: str, pressure: Value) -> None:
        """Along inward normals as they are then, the same unit; a number, or one a vertex."""
        self._set(("pressure", boundary), pressure, lambda p: self._simulation.set_pressure(boundary, p))

    def set_acceleration(self, acceleration: Value) -> None:
        """Body force by mass [m/s^2]."""
        self._set(("acceleration",), acceleration, self._simulation.set_acceleration)

    def move_obstacle(self, obstacle: str, positions: Union[Array, Callable[[float], Array]]) -> None:
        """Where its vertices are at the end of the next steps [m], or a function that says so of a time."""
        if callable(positions):
            move = self._functions[("obstacle", obstacle)] = lambda t: self._simulation.move_obstacle(obstacle, positions(t))
            move(self.time)
        else:
            self._functions.pop(("obstacle", obstacle), None)
            self._simulation.move_obstacle(obstacle, positions)

    def set_forces(self, forces: Optional[Value]) -> None:
        """Dead forces [N] on the vertices; they stay where they act however the mesh changes. None: no forces."""
        if forces is None:
            self._functions.pop(("forces",), None)
            self._simulation.set_forces([])
        else:
            self._set(("forces",), forces, lambda f: self._simulation.set_forces(self._nodal(f)))

    def set_follower_forces(
        self,
        forces: Optional[Callable[[Array, Array, float], Array]],
        stiffness: Optional[Callable[[Array, Array, float], tuple[Array, Array]]] = None,
    ) -> None:
        """Forces [N] of present positions: forces(X, x, t) gives an array as x (n x d). A step is solved with them, linearised,
        at the solution before, until they balance; with blocks of -df/dx that takes fewer rounds: stiffness(X, x, t) gives
        their vertices (m x k) and the blocks (m x kd x kd) [N/m]. Both are called once a round; n may be that of a new mesh.
        None: no such forces."""
        self._simulation.set_follower_forces(forces, stiffness)

    def set_term(self, name: str, energy: Compiled, gradient: Compiled, hessian: Compiled, user: int = 0) -> None:
        """Adds a term to the incremental potential, of the functions of `itr_term` in itr.h, or puts it in the place of the
        one of this name. `user` is the address that the functions get."""
        self._simulation.set_term(name, _address(energy), _address(gradient), _address(hessian), user)
        self._kept[name] = [energy, gradient, hessian]

    def remove_term(self, name: str) -> None:
        self._simulation.remove_term(name)
        self._kept.pop(name, None)

    def set_velocities(self, velocities: Value) -> None:
        """[m/s]"""
        self._simulation.set_velocities(self._nodal(self._sample(velocities, self.time)))

    def freeze_mesh(self, frozen: bool = True) -> None:
        """No remeshing while it is."""
        self._simulation.freeze_mesh(frozen)

    def _sample(self, value: Value, t: float) -> Array:
        return np.asarray(value(self.rest_positions, t) if callable(value) else value, dtype=float)

    def _nodal(self, values: Array) -> Array:
        return np.broadcast_to(values, self.positions.shape) if values.shape == (self.dimension,) else values

    def _set(self, key: tuple, value: Value, set_values: Callable[[Array], None]) -> None:
        """Values now, and of a function before each step again."""
        set_values(self._sample(value, self.time))
        if callable(value):
            self._functions[key] = lambda t: set_values(self._sample(value, t))
        else:
            self._functions.pop(key, None)

    # The state.

    @property
    def dimension(self) -> int:
        return self._simulation.dimension

    @property
    def positions(self) -> Array:
        """(n, d) [m]: a view without a copy, read-only, of the state as it is now (later steps leave it as it is)."""
        return self._simulation.positions

    @property
    def velocities(self) -> Array:
        """(n, d) [m/s], as positions."""
        return self._simulation.velocities

    @property
    def rest_positions(self) -> Array:
        """(n, d) [m]"""
        return self._simulation.rest_positions

    @property
    def cells(self) -> Array:
        """(m, d + 1)"""
        return self._simulation.cells

    @property
    def bodies(self) -> Array:
        """(m,)"""
        return self._simulation.bodies

    @property
    def facets(self) -> Array:
        """Of the boundary, outward: (k, d)"""
        return self._simulation.facets

    @property
    def facet_boundaries(self) -> Array:
        """(k,): ids of add_boundary, -1: none."""
        return self._simulation.facet_boundaries

    @property
    def obstacle_positions(self) -> Array:
        return self._simulation.obstacle_positions

    @property
    def elastic_density(self) -> Array:
        """(m,): of rest volume [J/m^d]"""
        return self._simulation.elastic_density

    @property
    def von_mises(self) -> Array:
        """(m,) [Pa]"""
        return self._simulation.von_mises

    @property
    def stress(self) -> Array:
        """(m, d * d): Cauchy's, row by row [Pa]"""
        return self._simulation.stress

    def watch_forces(self, watched: bool = True) -> None:
        """Asks for forces, which are there after the next step."""
        self._simulation.watch_forces(watched)

    def forces(self, kind: str) -> Optional[Array]:
        """(n, d) [N] of one of FORCES; None before a step with watched forces."""
        if kind not in FORCES:
            raise InputError(f"kind: found '{kind}'; expected one of {', '.join(FORCES)}")
        return self._simulation.forces(FORCES.index(kind))

    def resultant(
        self, boundaries: Union[str, Iterable[str]], about: Optional[Sequence[float]] = None
    ) -> tuple[Array, Array]:
        """Force [N] and moment [N m] of all kinds on boundaries, and of bodies on obstacles. Forces have to be watched."""
        names = [boundaries] if isinstance(boundaries, str) else list(boundaries)
        return self._simulation.resultant(names, np.zeros(self.dimension) if about is None else about)

    def save(self) -> Saved:
        """The state as it is, mesh included: cheap; the same steps from it have the same bits."""
        return self._simulation.save()

    def restore(self, saved: Saved) -> None:
        self._simulation.restore(saved)

    # Events; None: nobody listens.

    def on_iteration(self, listener: Optional[Callable[[int, float, float, float], bool]]) -> None:
        """Called after each Newton iteration with its number, energy, norms of gradient and step; False ends the step."""
        self._simulation.on_iteration(listener)

    def on_mesh_change(self, listener: Optional[Callable[[MeshChange], None]]) -> None:
        """Called after a step that changed the mesh. Values by vertex that fix() and others were given stay functions of the
        rest position."""
        self._simulation.on_mesh_change(None if listener is None else lambda data: listener(MeshChange(data)))

    # To other libraries.

    def to_meshio(self) -> meshio.Mesh:
        """A meshio.Mesh of the present positions with `displacement`, `velocity`, `body` and `elastic_density`."""
        from ._convert import to_meshio

        return to_meshio(self)

    def to_dolfinx(self, comm: Any = None) -> tuple[dolfinx.mesh.Mesh, dict[str, dolfinx.fem.Function]]:
        """The mesh at rest in dolfinx, on one rank, and functions on it: `displacement` and `velocity`, linear, and
        `elastic_density`, constant on cells. `comm`: an MPI communicator of one rank, else MPI.COMM_SELF."""
        from ._convert import to_dolfinx

        return to_dolfinx(self, comm)


def _ints(name: str, values: Any) -> Array:
    array = np.asarray(values)
    if array.size > 0 and not np.issubdtype(array.dtype, np.integer):
        raise InputError(f"{name}: found numbers of type {array.dtype}; expected integers")
    return np.ascontiguousarray(array, dtype=np.intc) if array.size else np.empty(0, np.intc)


def _address(function: Compiled) -> int:
    """0, which is refused, for None."""
    if function is None or isinstance(function, int):
        return function or 0
    if hasattr(function, "address"):  # numba
        return function.address
    import ctypes

    try:
        return ctypes.cast(function, ctypes.c_void_p).value or 0
    except ctypes.ArgumentError:
        raise InputError(f"function: found a {type(function).__name__}; expected a compiled one or its address") from None
