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

import gc
import operator
import tempfile
from typing import TYPE_CHECKING, Any, Callable, Iterable, Mapping, Optional, Sequence, Union

import numpy as np

from . import _load  # isort: skip
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
"""A constant (d numbers, one for a pressure), an array over the vertices of the present mesh (n x d, or n), or a function
of rest positions (n x d) and the time at the end of the step. A function is called once before each step."""
Compiled = Any
"""A function of C's calling convention: from a ctypes library, from numba.cfunc, or an address. Several threads call it within
a step, without Python's lock."""

FORCES = ("contact", "friction", "reaction", "applied", "body", "residual")


class StepFailed(RuntimeError):
    """A step failed. The state is as before it."""


class Cancelled(StepFailed):
    """A listener of Newton iterations cancelled the step. The state is as before it."""


class Model:
    """The description of a problem. Simulations copy it."""

    def __init__(self, vertices: Array, cells: Array, bodies: Optional[Array] = None):
        """`vertices`: (n, d) [m], d = 2 or 3. `cells`: (m, d + 1) of positive volume. `bodies`: an id a cell, by default 0.

        Quadratic cells, (m, 6) in 2D and (m, 10) in 3D, have a node at the middle of each edge in meshio's order (triangle6,
        tetra10). They must be straight at rest."""
        vertices = np.asarray(vertices, dtype=float)
        if vertices.ndim != 2:
            raise InputError(f"vertices: found an array of shape {vertices.shape}; expected (n, 2) or (n, 3)")
        self._model = _itr.Model(vertices.shape[1])
        self._kept: list = []  # what compiled functions live in
        ids = _ints("cells", cells)
        d = vertices.shape[1]
        is_quadratic = ids.ndim == 2 and ids.shape[1] == (d + 1) * (d + 2) // 2
        set_mesh = self._model.set_quadratic_mesh if is_quadratic else self._model.set_mesh
        set_mesh(vertices, ids, _ints("bodies", [] if bodies is None else bodies))

    @classmethod
    def from_scene(cls, file: str, overrides: Optional[Mapping[str, Any]] = None) -> "Model":
        """Reads a scene file. `overrides` has values by JSON pointer. Surfaces become boundaries by their names, or their
        ids: "1", "2"."""
        model = cls.__new__(cls)
        model._model = _itr.Model.from_scene(str(file), dict(overrides or {}))
        model._kept = []
        return model

    @classmethod
    def from_meshio(cls, mesh: meshio.Mesh) -> Model:
        """Takes the tetrahedra of a meshio.Mesh, or if there are none its triangles in the plane z = 0. Gmsh's physical groups
        of cells become bodies of the same numbers, those of facets boundaries of the same names or numbers. Names of physical
        groups and of sets of cells are names of bodies; sets of facets, and sets of points by the facets that have all points
        in them, are boundaries. Options may write these names as ids."""
        from ._convert import from_meshio

        vertices, cells, bodies, body_names, boundaries = from_meshio(mesh)
        model = cls(vertices, cells, bodies)
        for name, ids in body_names.items():
            for body in ids:
                model._model.name_body(name, body)
        for name, facets in boundaries.items():
            model.add_boundary(name, facets)
        return model

    @property
    def dimension(self) -> int:
        return self._model.dimension

    def set_options(self, options: Mapping[str, Any]) -> None:
        """Merges keys of a scene, other than geometry and output, into the options."""
        self._model.set_options(dict(options))

    def set_option(self, pointer: str, value: Any) -> None:
        """Sets one key: set_option("/time/dt", 0.01)."""
        self._model.set_option(pointer, value)

    def add_boundary(
        self,
        name: str,
        facets: Optional[Array] = None,
        box: Optional[tuple[Sequence[float], Sequence[float]]] = None,
        where: Optional[Callable[[Array], bool]] = None,
    ) -> int:
        """Names facets of the boundary: given by vertices (k, d), all in a box (low, high), or all whose middle X satisfies
        `where`. Returns the id for options."""
        if (facets is not None) + (box is not None) + (where is not None) != 1:
            raise InputError(f"boundary '{name}': expected one of facets, box and where")
        if facets is not None:
            return self._model.add_boundary_facets(name, _ints(f"boundary '{name}'", facets))
        if box is not None:
            return self._model.add_boundary_box(name, box[0], box[1])
        return self._model.add_boundary_rule(name, where)

    def add_obstacle(self, name: str, vertices: Array, edges: Array = (), triangles: Array = ()) -> int:
        """Adds an obstacle, which only collides. Returns the id for options."""
        return self._model.add_obstacle(name, vertices, _ints("edges", edges), _ints("triangles", triangles))

    def set_law(self, body: int, density: Compiled, stress: Compiled, hessian: Compiled, user: int = 0) -> None:
        """Sets the law of a body by the compiled functions of `itr_law` in itr.h. The options still give the body a material,
        for its density and as a scale. `user` is the address that the functions receive."""
        self._kept += [density, stress, hessian]
        self._model.set_law(body, _address(density), _address(stress), _address(hessian), user)


class MeshChange:
    """The change of a mesh within a step. `project` works only during the call of the listener.

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
        """Interpolation P as a scipy.sparse.csr_matrix, new vertices x old ones: `P @ field`."""
        from scipy.sparse import csr_matrix

        return csr_matrix((self._data["data"], self._data["indices"], self._data["indptr"]), shape=self._data["shape"])

    def interpolate(self, field: Array) -> Array:
        """Interpolates a field (n,) or (n, k) at the new vertices, without SciPy."""
        field = np.asarray(field, dtype=float)
        rows = np.repeat(np.arange(self._data["shape"][0]), np.diff(self._data["indptr"]))
        result = np.zeros((self._data["shape"][0],) + field.shape[1:])
        weights = self._data["data"].reshape((-1,) + (1,) * (field.ndim - 1))
        np.add.at(result, rows, weights * field[self._data["indices"]])
        return result

    def project(self, field: Array) -> Array:
        """Projects a field in L2, which keeps integrals."""
        field = np.asarray(field, dtype=float)
        return self._data["project"](field.reshape(len(field), -1)).reshape((-1,) + field.shape[1:])


class Simulation:
    """A simulation, advanced step by step. It copies the model. Two simulations are independent."""

    def __init__(self, model: Model, log: Optional[Callable[[int, str], None]] = None):
        """`log(level, message)` receives messages; levels are 0 debug, 1 information, 2 warning."""
        self._simulation = _itr.Simulation(model._model, log)
        self._functions: dict[tuple, Callable[[float], None]] = {}
        self._kept = {"laws": list(model._kept)}  # what compiled functions live in
        self._recorder: Optional[_itr.Recorder] = None

    # Steps.

    def step(self, dt: Optional[float] = None) -> dict:
        """Takes one step of length dt [s], by default that of the step before. Returns `report`. Raises StepFailed."""
        before, recorder = self.steps, self._recorder
        try:
            self._do(self._simulation.step, dt)
        finally:  # a step may be done when a listener raises, which may also begin a record of its own
            if recorder and recorder is self._recorder and self.steps > before:
                recorder.add(self._simulation)
        return self.report

    def adapt(self, dt: Optional[float] = None) -> None:
        """Finds the mesh of the next step and stays at the start of that step. Sub-iterations on a frozen mesh begin so."""
        self._do(self._simulation.adapt, self._simulation.step_length if dt is None else dt)

    def _do(self, step: Callable[[float], tuple], dt: Optional[float]) -> None:
        if dt is not None and not dt > 0:
            raise InputError(f"dt: found {dt:g}; expected a number > 0 of which a double holds the square")
        t = self.time + (self._simulation.step_length if dt is None else dt)
        for sample in self._functions.values():
            sample(t)
        ok, cancelled, reason = step(dt or 0.0)
        if not ok:
            raise (Cancelled if cancelled else StepFailed)(reason)

    @property
    def time(self) -> float:
        """Present time [s]."""
        return self._simulation.time

    @property
    def steps(self) -> int:
        """Number of steps taken."""
        return self._simulation.steps

    @property
    def finished(self) -> bool:
        """Whether all steps of the options are taken."""
        return self._simulation.finished

    @property
    def report(self) -> dict:
        """Sizes, iterations, operations and energies [J] of the last step, or of the start."""
        return self._simulation.report

    @property
    def warnings(self) -> list[str]:
        """Warnings about options that are legal and suspicious."""
        return self._simulation.warnings

    # Conditions and loads that act from the next step on.

    def fix(self, boundary: str, displacement: Value, mask: Optional[Sequence[bool]] = None) -> None:
        """Prescribes displacements from rest [m], for the components in `mask`. release() takes it back."""
        flags = np.ones(self.dimension, int) if mask is None else np.asarray(mask, int)
        self._set(("fix", boundary), displacement, lambda values: self._simulation.fix(boundary, flags, values))

    def release(self, boundary: str) -> None:
        self._functions.pop(("fix", boundary), None)
        self._simulation.fix(boundary, np.zeros(self.dimension, int), np.zeros(self.dimension))

    def set_traction(self, boundary: str, traction: Value) -> None:
        """Sets the force by rest area [N/m^2], in 2D by rest length [N/m]."""
        self._set(("traction", boundary), traction, lambda values: self._simulation.set_traction(boundary, values))

    def set_pressure(self, boundary: str, pressure: Value) -> None:
        """Sets the pressure against the deformed surface [N/m^2], in 2D [N/m]: a number, or one a vertex."""
        self._set(("pressure", boundary), pressure, lambda p: self._simulation.set_pressure(boundary, p))

    def set_acceleration(self, acceleration: Value) -> None:
        """Sets the body force by mass [m/s^2]."""
        self._set(("acceleration",), acceleration, self._simulation.set_acceleration)

    def set_eigenstrain(self, strain: Optional[Value]) -> None:
        """Sets the strain of the bodies where they are free of stress, the same in all directions, such as that of heat: a
        number, or one a vertex. None removes it, as it does one of the options."""
        if strain is None:
            self._functions.pop(("eigenstrain",), None)
            self._simulation.set_eigenstrain([])
        else:
            set_values = lambda e: self._simulation.set_eigenstrain(e if e.ndim else np.full(len(self.positions), e))
            self._set(("eigenstrain",), strain, set_values)

    def move_obstacle(self, obstacle: str, positions: Union[Array, Callable[[float], Array]]) -> None:
        """Moves an obstacle to positions at the end of the next steps [m], or by a function of time that returns them."""
        if callable(positions):
            move = self._functions[("obstacle", obstacle)] = lambda t: self._simulation.move_obstacle(obstacle, positions(t))
            move(self.time)
        else:
            self._functions.pop(("obstacle", obstacle), None)
            self._simulation.move_obstacle(obstacle, positions)

    def set_forces(self, forces: Optional[Value]) -> None:
        """Sets dead forces [N] on the vertices. They act on the same points when the mesh changes. None removes them."""
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
        """Sets forces [N] that depend on positions: forces(X, x, t) returns (n, d). A step is solved with them, linearised,
        at the solution before, until they balance; with blocks of -df/dx that takes fewer rounds: stiffness(X, x, t) gives
        their vertices (m x k) and the blocks (m x kd x kd) [N/m]. Both are called once a round; n may be that of a new mesh.
        None: no such forces."""
        self._simulation.set_follower_forces(forces, stiffness)

    def set_term(self, name: str, energy: Compiled, gradient: Compiled, hessian: Compiled, user: int = 0) -> None:
        """Adds a term to the incremental potential by the compiled functions of `itr_term` in itr.h, or replaces the one of
        this name. `user` is the address that the functions receive."""
        self._simulation.set_term(name, _address(energy), _address(gradient), _address(hessian), user)
        self._kept[name] = [energy, gradient, hessian]

    def remove_term(self, name: str) -> None:
        self._simulation.remove_term(name)
        self._kept.pop(name, None)

    def set_velocities(self, velocities: Value) -> None:
        """Sets the velocities of the bodies' vertices, (n, d) [m/s]."""
        self._simulation.set_velocities(self._nodal(self._sample(velocities, self.time)))

    def freeze_mesh(self, frozen: bool = True) -> None:
        """Stops remeshing while `frozen` is true."""
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
        """Positions (n, d) [m] of the vertices, then of the nodes of `curved_edges`, as a read-only view of the present state.
        Later steps do not change the view."""
        return self._simulation.positions

    @property
    def velocities(self) -> Array:
        """Velocities (n, d) [m/s], a view like `positions`."""
        return self._simulation.velocities

    @property
    def rest_positions(self) -> Array:
        """Rest positions (n, d) [m]."""
        return self._simulation.rest_positions

    @property
    def num_vertices(self) -> int:
        """Of the mesh; positions have as many rows more as there are curved edges."""
        return self._simulation.num_vertices

    @property
    def curved_edges(self) -> Array:
        """(k, 2): vertices of each, in the order of their nodes."""
        return self._simulation.curved_edges

    @property
    def cells(self) -> Array:
        """Cells (m, d + 1): ids of vertices."""
        return self._simulation.cells

    @property
    def bodies(self) -> Array:
        """Body of each cell (m,)."""
        return self._simulation.bodies

    @property
    def facets(self) -> Array:
        """Boundary facets (k, d), oriented outward."""
        return self._simulation.facets

    @property
    def facet_boundaries(self) -> Array:
        """Boundary of each facet (k,): ids of add_boundary, -1 for none."""
        return self._simulation.facet_boundaries

    @property
    def obstacle_positions(self) -> Array:
        return self._simulation.obstacle_positions

    @property
    def contact_pressure(self) -> Array:
        """Contact force by present area (n,) [Pa], in 2D [N/m]; below 0 where it pulls. Forces must be watched."""
        return self._simulation.contact_pressure

    @property
    def elastic_density(self) -> Array:
        """Elastic energy by rest volume of each cell (m,) [J/m^d]."""
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
        """Turns the computation of forces on or off, from the next step."""
        self._simulation.watch_forces(watched)

    def forces(self, kind: str) -> Optional[Array]:
        """Forces (n, d) [N] of one kind of FORCES. None before the first step in which forces are watched."""
        if kind not in FORCES:
            raise InputError(f"kind: found '{kind}'; expected one of {', '.join(FORCES)}")
        return self._simulation.forces(FORCES.index(kind))

    def resultant(
        self, parts: Union[str, int, Iterable[Union[str, int]]], about: Optional[Sequence[float]] = None
    ) -> tuple[Array, Array]:
        """Force [N] and moment [N m] of all kinds on boundaries and bodies, and of bodies on obstacles.

        A part is a name or an id: names are tried before ids, and of each those of boundaries, then obstacles, then bodies; "boundary:3", "obstacle:3" and
        "body:3" look among these alone. InputError for what nothing has. Forces must be watched."""
        names = [_part(part) for part in ([parts] if isinstance(parts, str) or not np.iterable(parts) else parts)]
        return self._simulation.resultant(names, np.zeros(self.dimension) if about is None else about)

    def save(self) -> Saved:
        """Saves the state, mesh included, at almost no cost. The same steps from it give the same bits."""
        return self._simulation.save()

    def restore(self, saved: Saved) -> None:
        self._recorder = None
        self._simulation.restore(saved)

    # Files.

    def record(self, folder: str, every: int = 1, overwrite: bool = False) -> None:
        """Stores this state and from now on each `every`-th step in `folder`, as `itr run` does: for `write_report`, ParaView and
        `itr certify`. A restored state ends it. No other run, nor simulation that records, may be at work in the folder."""
        self._recorder = None
        gc.collect()  # one that nobody has any more may hold the folder still
        self._recorder = _itr.Recorder(self._simulation, str(folder), every, overwrite)

    def write_report(self, file: str, every: int = 1, max_mb: float = 30) -> list[str]:
        """One HTML file that shows what `record` has stored, else the present state, in a browser; `every` and `max_mb` as of
        `itr report`. Returns what was left out for the size, as sentences."""
        if self._recorder:
            self._recorder.finish(self._simulation)
            return _itr.write_report(self._recorder.directory, str(file), every, max_mb)
        with tempfile.TemporaryDirectory() as folder:
            _itr.Recorder(self._simulation, folder, 1, False).finish(self._simulation)
            return _itr.write_report(folder, str(file), every, max_mb)

    # Events; None: nobody listens.

    def on_iteration(self, listener: Optional[Callable[[int, float, float, float], bool]]) -> None:
        """Calls `listener` after each Newton iteration with its number, energy and norms of gradient and step. False ends."""
        self._simulation.on_iteration(listener)

    def on_mesh_change(self, listener: Optional[Callable[[MeshChange], None]]) -> None:
        """Calls `listener` with a MeshChange after a step that changed the mesh. Arrays given to fix() and others remain
        functions of rest position."""
        self._simulation.on_mesh_change(None if listener is None else lambda data: listener(MeshChange(data)))

    # To other libraries.

    def to_meshio(self) -> meshio.Mesh:
        """Returns a meshio.Mesh at present positions with `displacement`, `velocity`, `body` and `elastic_density`."""
        from ._convert import to_meshio

        return to_meshio(self)

    def to_dolfinx(self, comm: Any = None) -> tuple[dolfinx.mesh.Mesh, dict[str, dolfinx.fem.Function]]:
        """Returns the mesh at rest in dolfinx, on one rank, and functions on it: `displacement` and `velocity`, linear, and
        `elastic_density`, constant on cells. `comm`: an MPI communicator of one rank, else MPI.COMM_SELF."""
        from ._convert import to_dolfinx

        return to_dolfinx(self, comm)


def _part(part: Any) -> str:
    """The text of a name or an id."""
    if isinstance(part, str):
        return part
    try:
        return str(operator.index(part))
    except TypeError:
        raise InputError(f"resultant: found {part!r}; expected a name or an id") from None


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
