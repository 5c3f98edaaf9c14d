# SPDX-License-Identifier: MIT
"""Scenes of the hard-contact set that no other set has: users' scenes, cracks, thin parts, rolling, snapping, closed forms, and a
published one. A function fills a Scene (make.py); lengths are in Scene.size [m], y is up."""
import math

import numpy as np
from bodies import ball_mesh
from harness.scenes import box_mesh

SCENES = {}


def scene(kind, *names, **variants):
    """Registers a function (scene) under its name or `names`, or (scene, value) under name=value of `variants`."""
    def register(function):
        for name in names or ([] if variants else [function.__name__]):
            SCENES[name] = function, kind
        for name, value in variants.items():
            def filled(scene, value=value):
                function(scene, value)
            filled.__doc__ = function.__doc__
            SCENES[name] = filled, kind
        return function
    return register


def solve(function, low, high):
    """A zero of a growing function between two bounds, by bisection."""
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if function(middle) < 0 else (low, middle)
    return (low + high) / 2


def cut(points, cells, keep):
    """The cells whose middles are kept, and their points."""
    cells = cells[keep(points[cells].mean(axis=1))]
    used, cells = np.unique(cells, return_inverse=True)
    return points[used], cells.reshape(-1, points.shape[1] + 1)


def turned(points, degrees):
    angle = math.radians(degrees)
    return points @ np.array([[math.cos(angle), math.sin(angle)], [-math.sin(angle), math.cos(angle)]])


def chain(scene, points, closed=False, move=None):
    edges = [(k, k + 1) for k in range(len(points) - 1)] + ([(len(points) - 1, 0)] if closed else [])
    scene.obstacle(points, edges=edges, move=move)


def plate(scene, y, reach=3.0, move=None, middle=0.0):
    """A flat obstacle across y."""
    if scene.dim == 2:
        chain(scene, [[middle - reach, y], [middle + reach, y]], move=move)
        return
    corners = [[middle + a * reach, y, middle + b * reach] for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    scene.obstacle(corners, faces=[(0, 1, 2), (0, 2, 3)], move=move)


# --- users' scenes: what examples/ does, on meshes of the script -------------------------------------------------------

@scene("user", user_drop=None, user_drop_remeshed=0.02)
def drop(scene, remesh):
    """A tilted square falls on a floor with friction (examples/tasks/drop.json)."""
    scene.size, scene.dt, scene.steps, scene.friction, scene.remesh, scene.from_user = 0.1, 0.005, 60, 0.3, remesh, True
    points, cells = box_mesh([6, 6], [1, 1])
    scene.body(turned(points - 0.5, 20) + [0, 1.5], cells, nu=0.4)
    scene.floor()


@scene("user", user_press=None, user_press_remeshed=0.5)
def press(scene, remesh):
    """A disc between plates that close to two fifths of its width, with friction (examples/tasks/press.json)."""
    scene.size, scene.dt, scene.steps, scene.friction, scene.gravity, scene.kappa = 0.1, 0.05, 20, 0.2, 0.0, 1e6
    scene.remesh, scene.from_user = remesh, True
    scene.body(*ball_mesh(2, 12, 0.5, (0, 0)), E=1e6, nu=0.45)
    plate(scene, -0.505)
    plate(scene, 0.505, move=[0, "-0.06 * t"])


@scene("user")
def user_twist(scene):
    """A bar is twisted by half a turn until its sides touch (examples/tasks/twist.json)."""
    scene.dim, scene.size, scene.dt, scene.steps, scene.quasistatic, scene.gravity, scene.from_user = 3, 0.1, 0.05, 20, True, 0.0, True
    body = scene.box([16, 3, 3], [0, -0.15, -0.15], [2, 0.15, 0.15], nu=0.4)
    scene.hold(body, 1)
    scene.hold(body, 3, [0, "y * (cos(3 * t) - 1) - z * sin(3 * t)", "y * sin(3 * t) + z * (cos(3 * t) - 1)"])


@scene("user")
def user_cubes(scene):
    """A tilted soft cube falls on another one (examples/cubes.json)."""
    scene.dim, scene.size, scene.dt, scene.steps, scene.friction, scene.from_user = 3, 0.1, 0.01, 40, 0.3, True
    scene.box([3, 3, 3], [-0.5, 0.02, -0.5], [0.5, 1.02, 0.5], nu=0.4)
    points, cells = box_mesh([3, 3, 3], [1, 1, 1])
    points -= 0.5
    points[:, :2] = turned(points[:, :2], 35)
    points[:, 1:] = turned(points[:, 1:], 20)
    scene.body(points + [0.2, 2.0, 0.1], cells, E=2e4, nu=0.45)
    scene.floor()


@scene("user", user_ball_wall=None, user_ball_wall_remeshed=0.0025)
def ball_wall(scene, remesh):
    """A disc of 8 cm meets a wall at 67 m/s (examples/ball_wall.json)."""
    scene.size, scene.dt, scene.steps, scene.gravity, scene.remesh, scene.from_user = 0.08, 2e-5, 100, 0.0, remesh, True
    scene.body(*ball_mesh(2, 16, 0.5, (0, 0.51)), E=1e6, nu=0.45, rho=1150.0, velocity=[0, -67.0])
    scene.floor()


@scene("user")
def user_masticator(scene):
    """A beam between two rows of teeth that close and open, with friction (examples/masticator.json)."""
    scene.dt, scene.steps, scene.gravity, scene.friction, scene.kappa, scene.from_user = 0.05, 200, 0.0, 0.1, 1e3, True
    scene.box([40, 8], [-2, -0.25], [2, 0.25], E=1e4, nu=0.4)
    for sign, middles in ((1, (-1, 0, 1)), (-1, (-1.5, -0.5, 0.5, 1.5))):
        for x in middles:
            box = [[x + a * 0.125, sign * 0.51 + b * 0.125] for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
            chain(scene, box, closed=True, move=[0, f"{-sign * 0.76} * (1 - abs(1 - t / 5))"])


# --- cracks --------------------------------------------------------------------------------------------------------------

def slit(counts, size, opening):
    """A box with a slit at half its height in the middle half of its width (and depth), a lens that is open by twice `opening`."""
    points, cells = box_mesh(counts, size)
    half = size[1] / 2
    inner = np.isclose(points[:, 1], half)
    lens = np.ones(len(points))
    for axis in range(len(size)):
        if axis != 1:
            across = (points[:, axis] - size[axis] / 2) / (size[axis] / 4)
            inner &= np.abs(across) < 1 - 1e-9
            lens *= 1 - across**2
    twin = np.arange(len(points))
    twin[inner] = len(points) + np.arange(inner.sum())
    upper = points[cells].mean(axis=1)[:, 1] > half
    cells = np.where(upper[:, None], twin[cells], cells)
    faces = np.concatenate([points, points[inner]])
    faces[np.flatnonzero(inner), 1] -= opening * lens[inner]
    faces[len(points):, 1] += opening * lens[inner]
    return faces, cells


@scene("crack", crack_shut_2d=(2, 0.0, 0.0), crack_slides_2d=(2, 0.3, 0.15), crack_shut_3d=(3, 0.0, 0.0), crack_slides_3d=(3, 0.3, 0.15))
def crack(scene, value):
    """A block with an inner crack, open by 4e-3 at most, is pressed until it is shut, or pressed and sheared, with friction."""
    scene.dim, scene.friction, slide = value
    scene.quasistatic, scene.gravity, scene.dt, scene.steps, scene.dhat, scene.from_user = True, 0.0, 0.1, 10, 2e-4, True
    body = scene.body(*slit([16, 8, 8][:scene.dim], [2, 1, 1][:scene.dim], 2e-3))
    scene.hold(body, 2)
    scene.hold(body, 4, [f"{slide} * max(0, t - 0.3)", "-0.1 * min(1, 2 * t)", 0][:scene.dim])


# --- thin parts ------------------------------------------------------------------------------------------------------------

@scene("thin")
def thin_strip_between_walls_2d(scene):
    """A strip a hundredth as thick as long buckles between two walls while its ends come together by a fifth."""
    scene.gravity, scene.dt, scene.steps, scene.friction, scene.kappa, scene.from_user = 0.0, 0.02, 50, 0.2, 1e5, True
    points, cells = box_mesh([60, 2], [2, 0.02])
    points[:, 1] += 0.01 * np.sin(np.pi * points[:, 0])
    body = scene.body(points, cells, E=1e7)
    scene.hold(body, 1)
    scene.hold(body, 3, ["-0.4 * t", 0])
    plate(scene, -0.15, middle=1)
    plate(scene, 0.2, middle=1)


@scene("thin", thin_layers_2d=2, thin_layers_3d=3)
def layers(scene, dim):
    """Eight thin layers (in 3D four) on each other with gaps of half of d-hat, pressed to two thirds of their height, with friction."""
    scene.dim, scene.dt, scene.steps, scene.friction, scene.from_user = dim, 0.02, 30, 0.3, True
    scene.floor()
    number = 8 if dim == 2 else 4
    for k in range(number):
        low = 0.0005 + 0.0205 * k
        scene.box([20, 1] if dim == 2 else [10, 1, 3], [0.01 * (k % 2), low, 0][:dim], [1 + 0.01 * (k % 2), low + 0.02, 0.3][:dim])
    height = 0.0005 + 0.0205 * number
    plate(scene, height, move=[0, f"{-0.55 * height:.6g} * t", 0][:dim])


@scene("thin")
def thin_sheet_on_wires_3d(scene):
    """A sheet of one layer of cells falls over two crossed wires and a point, without friction."""
    scene.dim, scene.dt, scene.steps, scene.from_user = 3, 0.01, 50, True
    scene.box([12, 1, 12], [-0.5, 0.01, -0.5], [0.5, 0.04, 0.5], E=1e5)
    scene.obstacle([[-2, 0, 0.03], [2, 0, 0.03]], edges=[(0, 1)])
    scene.obstacle([[0.11, 0, -2], [0.11, 0, 2]], edges=[(0, 1)])
    scene.obstacle([[-0.27, -0.05, -0.31]])


@scene("thin")
def thin_wedge_2d(scene):
    """Needles: two combs of long triangles are pushed into each other's gaps, with friction."""
    scene.gravity, scene.dt, scene.steps, scene.friction, scene.from_user = 0.0, 0.02, 50, 0.2, True
    for sign in (1, -1):
        points, cells = [], []
        for k in range(6):
            x, first = 0.2 * k + (0.1 if sign < 0 else 0.0), len(points)
            points += [[x, 0.01 * sign], [x + 0.09, 0.8 * sign], [x - 0.09, 0.8 * sign]]
            cells += [[first, first + 1, first + 2] if sign > 0 else [first, first + 2, first + 1]]
        body = scene.body(points, cells, E=1e6)
        scene.hold(body, 4 if sign > 0 else 2, [0, f"{-0.35 * sign} * t"])


# --- rolling and sliding, with closed forms ---------------------------------------------------------------------------------

G = 9.81


def slope(scene, degrees):
    """A plane through the origin that falls to the right."""
    chain(scene, turned(np.array([[-20.0, 0.0], [60.0, 0.0]]), -degrees))


@scene("rolling", roll_slope_2d=12, roll_coarse_wheel_2d=3)
def roll(scene, cells):
    """A wheel of 48 or 12 edges on a slope of 15 degrees (examples/tasks/roll.json); by its edges the coarse one could stand there."""
    scene.size, scene.dt, scene.steps, scene.friction, scene.kappa, scene.from_user = 0.1, 0.005, 100, 0.5, 1e6, True
    points, simplices = ball_mesh(2, cells, 0.5, (0, 0.5005))
    scene.body(turned(points, -15), simplices, E=1e6, nu=0.4)
    slope(scene, 15)
    if cells > 3:
        way = 2 / 3 * G * math.sin(math.radians(15)) * scene.dt**2 * scene.steps * (scene.steps + 1) / 2
        scene.reference("centre", way * math.cos(math.radians(15)), 0.05, "disc that rolls, by implicit Euler's sum", body=1, axis=0,
                        moved=True)


@scene("rolling")
def roll_between_2d(scene):
    """A disc rolls between two plates, of which the upper one moves: it goes half of the way."""
    scene.dt, scene.steps, scene.friction, scene.gravity, scene.from_user = 0.02, 50, 0.5, 0.0, True
    scene.body(*ball_mesh(2, 16, 0.5, (0, 0)), nu=0.4)
    plate(scene, -0.5005)
    plate(scene, 0.5005, move=["max(0, t - 0.2) * max(0, t - 0.2)", "-0.1 * min(1, 5 * t)"])
    scene.reference("centre", 0.32, 0.05, "symmetry: half of the plate's way", body=1, axis=0, moved=True)


@scene("rolling")
def roll_ball_3d(scene):
    """A polyhedron of a ball rolls down a slope of 20 degrees over its faces and edges, with friction."""
    scene.dim, scene.size, scene.dt, scene.steps, scene.friction, scene.kappa, scene.from_user = 3, 0.1, 0.01, 40, 0.6, 1e5, True
    points, cells = ball_mesh(3, 5, 0.5, (0, 0.51, 0))
    points[:, :2] = turned(points[:, :2], -20)
    scene.body(points, cells, nu=0.4)
    corners = np.array([[-2.0, 0.0], [20.0, 0.0], [20.0, 0.0], [-2.0, 0.0]])
    scene.obstacle(np.column_stack([turned(corners, -20), [-5, -5, 5, 5]]), faces=[(0, 2, 1), (0, 3, 2)])


@scene("sliding", slide_slope_2d=2, slide_slope_3d=3)
def slide(scene, dim):
    """A block slides down a slope of 30 degrees with a friction of 0.2."""
    scene.dim, scene.dt, scene.steps, scene.friction, scene.kappa, scene.from_user = dim, 0.01, 60, 0.2, 1e6, True
    points, cells = box_mesh([6, 2, 3][:dim], [1, 0.3, 0.5][:dim])
    points[:, 1] += 0.0007
    points[:, :2] = turned(points[:, :2], -30)
    scene.body(points, cells, E=1e6)
    if dim == 2:
        slope(scene, 30)
    else:
        line = turned(np.array([[-20.0, 0.0], [60.0, 0.0], [60.0, 0.0], [-20.0, 0.0]]), -30)
        scene.obstacle(np.column_stack([line, [-5, -5, 5, 5]]), faces=[(0, 2, 1), (0, 3, 2)])
    angle = math.radians(30)
    way = G * (math.sin(angle) - 0.2 * math.cos(angle)) * scene.dt**2 * scene.steps * (scene.steps + 1) / 2
    scene.reference("centre", way * math.cos(angle), 0.03, "Coulomb, by implicit Euler's sum", body=1, axis=0, moved=True)


# --- snapping ----------------------------------------------------------------------------------------------------------------

@scene("snapping", snap_arch_2d=2, snap_arch_3d=3)
def arch(scene, dim):
    """A shallow arch, held at its ends, is pushed through by a sharp punch until it snaps to the other side."""
    scene.dim, scene.gravity, scene.dt, scene.steps, scene.friction, scene.kappa, scene.from_user = dim, 0.0, 0.02, 50, 0.2, 1e5, True
    points, cells = box_mesh([30, 2, 4][:dim], [2, 0.06, 0.3][:dim])
    points[:, 1] += 0.2 * np.sin(np.pi * points[:, 0] / 2)
    body = scene.body(points, cells, E=1e6)
    scene.hold(body, 1)
    scene.hold(body, 3)
    tip = [[0.85, 0.6], [0.98, 0.262], [1.15, 0.6]]
    move = [0, "-0.5 * t", 0][:dim]
    if dim == 2:
        chain(scene, tip, closed=True, move=move)
        return
    scene.obstacle([[x, y, z] for x, y in tip for z in (-0.5, 0.8)], move=move,
                   faces=[(0, 2, 1), (1, 2, 3), (2, 4, 3), (3, 4, 5), (4, 0, 5), (5, 0, 1)])


@scene("snapping")
def snap_hook_2d(scene):
    """A hook on a beam is pushed over a catch until it snaps in behind it, with friction (examples/assemblies)."""
    scene.size, scene.quasistatic, scene.gravity, scene.dt, scene.steps, scene.friction = 1e-3, True, 0.0, 0.02, 50, 0.3
    scene.dhat, scene.kappa, scene.from_user = 1e-2, 1e6, True
    points, cells = box_mesh([48, 6], [24, 3])
    points[:, 1] -= 1
    points, cells = cut(points, cells, lambda m: (m[:, 1] > 0) | (m[:, 0] > 20))
    nose = (points[:, 1] < 0) & (points[:, 0] > 21)
    points[nose, 1] *= 1 - 0.3 * (points[nose, 0] - 21)
    body = scene.body(points, cells, E=2e6, nu=0.38)
    scene.hold(body, 1, ["0.0065 * t", 0])
    chain(scene, [[25, -4], [25, -0.3], [26, -0.3], [26, -4]], closed=True)


# --- closed forms of pressing and impact --------------------------------------------------------------------------------------

@scene("closed form", patch_pressed_2d=2, patch_pressed_3d=3)
def patch(scene, dim):
    """A block between two plates without friction, pressed to four fifths: every cell has one strain."""
    scene.dim, scene.quasistatic, scene.gravity, scene.dt, scene.steps, scene.dhat = dim, True, 0.0, 0.1, 10, 1e-4
    E, nu = 1e5, 0.3
    body = scene.box([5, 5, 3][:dim], [0] * dim, [1] * dim, jitter=0.2, E=E, nu=nu)
    scene.hold(body, 1, only=[True, False, False][:dim])
    if dim == 3:
        scene.hold(body, 5, only=[False, False, True])
    plate(scene, -5e-5)
    plate(scene, 1 + 5e-5, move=[0, "-0.2 * t", 0][:dim])
    mu, lam = E / 2 / (1 + nu), E * nu / (1 - nu**2) if dim == 2 else E * nu / (1 + nu) / (1 - 2 * nu)
    down, sides = 0.8, dim - 1
    stress = lambda other, one: mu * (one - 1 / one) + lam * math.log(down * other**sides) / one  # noqa: E731
    other = solve(lambda side: stress(side, side), 1.0, 1.5)
    log = math.log(down * other**sides)
    energy = mu / 2 * (down**2 + sides * other**2 - dim - 2 * log) + lam / 2 * log**2
    scene.reference("elastic energy", energy, 0.01, "one strain, sides free, by the law")
    scene.reference("force", -stress(other, down), 0.01, "one strain, sides free, by the law", on="obstacle2", axis=1)


@scene("closed form", weight_on_floor_2d=2, weight_on_floor_3d=3)
def weight(scene, dim):
    """A block comes down on the floor and rests there by its weight, without inertia."""
    scene.dim, scene.quasistatic, scene.dt, scene.steps = dim, True, 0.1, 2
    E, rho = 1e6, 1000.0
    body = scene.box([5, 5, 3][:dim], [0, 5e-4, 0][:dim], [1, 1.0005, 1][:dim], E=E, nu=0.3, rho=rho)
    scene.hold(body, 1, only=[True, False, False][:dim])
    if dim == 3:
        scene.hold(body, 5, only=[False, False, True])
    plate(scene, 0.0)
    scene.reference("force", -rho * G, 1e-3, "weight", on="obstacle1", axis=1)


@scene("closed form")
def bar_on_wall_2d(scene):
    """A long bar meets a wall at 0.5 m/s and leaves when its wave is back."""
    E, rho = 1e6, 1000.0
    scene.gravity, scene.kappa, scene.dhat = 0.0, 1e6, 1e-4
    scene.steps = 520
    scene.dt = 2 / math.sqrt(E / rho) / 400
    scene.box([2, 40], [0, 2e-4], [0.1, 1.0002], E=E, nu=0.0, rho=rho, velocity=[0, -0.5])
    scene.floor()
    scene.reference("momentum", 0.1 * rho * 0.5, 0.1, "d'Alembert; implicit Euler takes some of it", axis=1)


@scene("impact", collide_free_2d=2, collide_free_3d=3)
def collide(scene, dim):
    """Two free blocks meet with an offset and turn away, without weight or friction: all momentum is kept."""
    scene.dim, scene.gravity, scene.dt, scene.steps = dim, 0.0, 0.005, 40
    counts = [4, 4, 3][:dim]
    scene.box(counts, [0, 0.01, 0][:dim], [1, 1.01, 0.7][:dim], velocity=[0, -1.0, 0][:dim])
    scene.box(counts, [0.6, -1.0, 0.2][:dim], [1.6, 0.0, 0.9][:dim], rho=2000.0, velocity=[0.2, 1.0, 0][:dim])


# --- a published scene ----------------------------------------------------------------------------------------------------------

@scene("published", squishy_balls=6, squishy_balls_fine=10)
def squishy(scene, cells):
    """Five soft balls in a frame are pressed by a plate that starts 1e-3 m above them, until 5 mm are left, and let go."""
    scene.dim, scene.size, scene.gravity, scene.dt, scene.steps, scene.from_user = 3, 0.01, 0.0, 0.01, 80, True
    scene.kappa, scene.dhat = 1e4, 1e-2
    for x, z in ((0, 0), (1.5, 1.5), (-1.5, 1.5), (1.5, -1.5), (-1.5, -1.5)):
        scene.body(*ball_mesh(3, cells, 1.0, (x, 1.02, z)), E=1e4, nu=0.4, rho=100.0)
    plate(scene, 0.0, reach=4)
    plate(scene, 2.12, reach=4, move=[0, "-0.0162 * (min(1, t / 0.5) - max(0, min(1, (t - 0.5) / 0.1)))", 0])
    for axis in (0, 2):
        for side in (-3.3, 3.3):
            corners = np.array([[0.0, a, b] for a, b in ((-1, -4), (6, -4), (6, 4), (-1, 4))])
            corners[:, 0] = side
            scene.obstacle(corners[:, [0, 1, 2] if axis == 0 else [2, 1, 0]], faces=[(0, 1, 2), (0, 2, 3)])
