# SPDX-License-Identifier: MIT
"""Wrong input and the message of the error that the Python package gives: the cases of bad_input_test.cpp."""
import ctypes

import itr
import numpy as np

OPTIONS = {
    "materials": {"type": "NeoHookean", "E": 1e5, "nu": 0.3, "rho": 1000},
    "time": {"dt": 0.01, "time_steps": 10},
    "contact": {"enabled": True, "dhat": 1e-3},
}


def block(n=3, size=0.2):
    vertices = np.array([(i, j) for j in range(n + 1) for i in range(n + 1)]) * (size / n)
    a = np.array([j * (n + 1) + i for j in range(n) for i in range(n)])
    return vertices, np.concatenate([np.stack([a, a + 1, a + n + 2], 1), np.stack([a, a + n + 2, a + n + 1], 1)])


def message_of(call):
    try:
        call()
    except itr.InputError as error:
        return str(error)
    return "no error"


def messages():
    """The message of each case by its name."""
    nan, inf = float("nan"), float("inf")
    wall = [[1, 0], [1, 1]]

    def model(vertices=None, cells=None):
        points, triangles = block()
        made = itr.Model(points if vertices is None else vertices, triangles if cells is None else cells)
        made.add_boundary("left", box=([0, 0], [0, 1]))
        made.add_obstacle("wall", wall, edges=[[0, 1]])
        made.set_options(OPTIONS)
        return made

    def made(change):
        changed = model()
        change(changed)
        itr.Simulation(changed)

    def changed(array, place, value):
        array = array.copy()
        array.flat[place] = value
        return array

    points, triangles = block()
    with_nan = changed(np.full((16, 2), 0.1), 3, nan)
    swapped = triangles.copy()
    swapped[0, :2] = triangles[0, 1::-1]
    law = [ctypes.CFUNCTYPE(ctypes.c_double)(lambda: 0.0)] * 3
    s = itr.Simulation(model())

    def follow(*functions):
        simulation = itr.Simulation(model())
        simulation.set_follower_forces(*functions)
        simulation.step()

    cases = {
        "vertex": lambda: model(vertices=changed(points, 5, nan)),
        "cell": lambda: model(cells=changed(triangles, 4, 16)),
        "inverted cell": lambda: itr.Simulation(model(cells=swapped)),
        "facet": lambda: made(lambda m: m.add_boundary("top", [[0, 16]])),
        "inner facet": lambda: made(lambda m: m.add_boundary("top", [[0, 5]])),
        "empty box": lambda: made(lambda m: m.add_boundary("top", box=([5, 5], [6, 6]))),
        "name": lambda: made(lambda m: m.add_boundary("left", [[0, 1]])),
        "obstacle vertex": lambda: made(lambda m: m.add_obstacle("floor", [[0, 0], [1, inf]], [[0, 1]])),
        "obstacle edge": lambda: made(lambda m: m.add_obstacle("floor", wall, [[0, 2]])),
        "unknown key": lambda: made(lambda m: m.set_option("/contact/dhatt", 1)),
        "time step": lambda: made(lambda m: m.set_option("/time/dt", -1)),
        "law": lambda: made(lambda m: m.set_law(3, *law)),
        "step": lambda: s.step(-1),
        "boundary": lambda: s.fix("lefd", with_nan),
        "displacement": lambda: s.fix("left", with_nan),
        "traction": lambda: s.set_traction("left", with_nan),
        "pressure": lambda: s.set_pressure("left", changed(np.zeros(16), 3, nan)),
        "acceleration": lambda: s.set_acceleration(with_nan),
        "force": lambda: s.set_forces(with_nan),
        "velocity": lambda: s.set_velocities(with_nan),
        "obstacle": lambda: s.move_obstacle("door", wall),
        "obstacle position": lambda: s.move_obstacle("wall", [[0, nan], [0, 0]]),
        "obstacle positions": lambda: s.move_obstacle("wall", [[0, 0]]),
        "follower force": lambda: follow(lambda X, x, t: changed(0 * x, 3, nan)),
        "follower vertex": lambda: follow(lambda X, x, t: 0 * x, lambda X, x, t: ([[16]], np.zeros((1, 2, 2)))),
        "resultant": lambda: s.resultant("lefd"),
        "not watched": lambda: s.resultant("left"),
    }
    return {name: message_of(call) for name, call in cases.items()}
