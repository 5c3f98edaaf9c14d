#!/usr/bin/python3
# SPDX-License-Identifier: MIT
"""Draws what `itr run` left in a folder: the deformed mesh, cells coloured by a field, obstacles in grey.

usage: render.py RESULTS [-o out.png] [--frames i,j,k] [--animation out.gif] [--field NAME] [--view x,y,z] [--zoom S]
                 [--cut x,y,z,d] [--range low,high]
       render.py RESULTS --forces [NAME,...] [-o out.png]

Without --frames: the first stored step, the one with the largest elastic energy, and the last. NAME is any dataset of the
frames' /fields: of vectors and tensors the magnitude counts, of fields on vertices the mean of a cell's; or order, which is 1
where all edges of a cell are straight and 2 where all are curved. Default:
elastic_density, on a logarithmic scale; other colours span the 1st to the 99th percentile, or --range. Solid bodies are drawn
by VTK (solid_images.py), obstacles translucent. --forces plots forces.csv over time, of all curves or of those that are named.
"""

import argparse
import csv
import json
import pathlib

import h5py
import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import LogNorm, Normalize
from matplotlib.cm import ScalarMappable
from PIL import Image

from solid_images import CURVE_PARTS, SolidImages, ensure_display

DECADES = 5  # of energy density that the colours span below its maximum
MAX_ANIMATION_FRAMES = 150
ANIMATION_DPI = 90
PANEL_PIXELS = 900
COLOURS = "YlOrRd"
ORDER = "order"  # what --field may ask for beside /fields


def units_of(file):
    """Length, mass and time of an open frame."""
    return file["/units"][()].tobytes().decode().split() if "/units" in file else ["m", "kg", "s"]


FACTORS = {"nm": 1e-9, "um": 1e-6, "mm": 1e-3, "cm": 1e-2, "dm": 0.1, "m": 1, "km": 1e3, "ug": 1e-9, "mg": 1e-6, "g": 1e-3,
           "kg": 1, "t": 1e3, "ns": 1e-9, "us": 1e-6, "ms": 1e-3, "s": 1}
PREFIXES = {1e-12: "p", 1e-9: "n", 1e-6: "u", 1e-3: "m", 1: "", 1e3: "k", 1e6: "M", 1e9: "G", 1e12: "T"}


def force_unit(length, mass, time):
    """As the command names it: N with a prefix where one says it."""
    if {length, mass, time} <= set(FACTORS):
        newtons = FACTORS[mass] * FACTORS[length] / FACTORS[time] ** 2
        for factor, prefix in PREFIXES.items():
            if abs(newtons - factor) <= 1e-9 * factor:
                return prefix + "N"
    return f"{mass} {length}/{time}^2"


class Frame:
    """One frames/NNNNNN.h5."""

    def __init__(self, path, field="elastic_density"):
        with h5py.File(path, "r") as file:
            if field != ORDER and field not in file["/fields"]:
                raise SystemExit(f"{path}: no field {field}; there are {', '.join(file['/fields'])} (docs/scenes.md, "
                                 "/output/paraview/options, says how to ask for others)")
            self.step, self.t = int(file.attrs["step"]), float(file.attrs["t"])
            self.x, self.rest = file["/fields/x"][:], file["/mesh/rest"][:]
            self.cells = file["/mesh/simplices"][:]
            curved = file["/mesh/curved_edges"][:] if "/mesh/curved_edges" in file else np.empty((0, 2), int)
            values = np.empty(0) if field == ORDER else file["/fields"][field][:]
            self.unit = "" if field == ORDER else file["/fields"][field].attrs.get("unit", "")
            self.time_unit = units_of(file)[2]
            self.obstacle_x = file["/obstacles/x"][:]
            self.obstacle_edges = file["/obstacles/edges"][:]
            self.obstacle_faces = file["/obstacles/faces"][:]
        self.dim = self.x.shape[1]
        self.num_vertices = len(self.x) - len(curved)
        self.middles = {tuple(edge): self.num_vertices + i for i, edge in enumerate(curved.tolist())}
        if field == ORDER:
            self.values = np.array([self.order(cell) for cell in self.cells.tolist()])
            return
        values = np.linalg.norm(values, axis=1) if values.ndim > 1 else values
        self.values = values if len(values) == len(self.cells) else values[self.cells].mean(axis=1)

    def order(self, cell):
        """1 where all edges are straight, 2 where all are curved."""
        edges = [(min(a, b), max(a, b)) for i, a in enumerate(cell) for b in cell[i + 1:]]
        return 1 + sum(edge in self.middles for edge in edges) / len(edges)

    def nodes(self):
        curved = f", {len(self.middles)} curved edges" if self.middles else ""
        return f"{self.num_vertices} vertices{curved}"

    def side(self, a, b, parts=CURVE_PARTS):
        """Points of the edge from vertex a to b, without b: more than one where it is curved."""
        middle = self.middles.get((min(a, b), max(a, b)))
        if middle is None:
            return self.x[a][None]
        s = np.arange(parts)[:, None] / parts
        return (1 - s) * (1 - 2 * s) * self.x[a] + s * (2 * s - 1) * self.x[b] + 4 * s * (1 - s) * self.x[middle]

    def outlines(self):
        """A polygon for each triangle, along its curved edges."""
        if not self.middles:
            return self.x[self.cells]
        return [np.concatenate([self.side(a, b), self.side(b, c), self.side(c, a)]) for a, b, c in self.cells.tolist()]

    def outer_faces(self, kept):
        """Of the tetrahedra `kept`: the vertices of the faces that only one of them has, and whose they are."""
        faces = np.concatenate([np.delete(self.cells[kept], k, axis=1) for k in range(4)])
        _, first, count = np.unique(np.sort(faces, axis=1), axis=0, return_index=True, return_counts=True)
        outer = first[count == 1]
        return faces[outer], np.tile(kept, 4)[outer]


def frame_paths(folder):
    paths = {int(path.stem): path for path in sorted((folder / "frames").glob("*.h5"))}
    if not paths:
        raise SystemExit(f"{folder}: no frames/*.h5 there; expected a folder that `itr run` wrote")
    return paths


def elastic_energies(folder):
    """Step -> elastic energy [J], as steps.jsonl says."""
    log = folder / "steps.jsonl"
    if not log.exists():
        return {}
    steps = [json.loads(line) for line in log.read_text().splitlines()]
    return {step["step"]: step["energy"]["elastic"] or 0 for step in steps}


def choose_frames(folder, paths, asked):
    if asked:
        chosen = [int(step) for step in asked.split(",")]
        absent = [step for step in chosen if step not in paths]
        if absent:
            raise SystemExit(f"--frames: no step {absent[0]} in {folder}; stored are {min(paths)} to {max(paths)}")
        return chosen
    steps = sorted(paths)
    inner = steps[1:-1]
    energies = elastic_energies(folder)
    during = [max(inner, key=lambda step: energies.get(step, 0))] if inner else []
    return sorted({steps[0], *during, steps[-1]})


def common_norm(frames, is_logarithmic, given=None):
    """Colours of all frames: `given`, or what leaves out the hundredth of the cells at either end."""
    values = np.concatenate([frame.values for frame in frames]) if frames else np.zeros(1)
    if given:
        return (LogNorm if is_logarithmic and given[0] > 0 else Normalize)(*given, clip=True)
    if not is_logarithmic:
        return Normalize(*np.percentile(values, [1, 99]), clip=True)
    largest = values.max(initial=0) or 1
    return LogNorm(largest / 10**DECADES, largest, clip=True)


def common_box(frames):
    """Smallest box around the bodies in all frames, with a margin; obstacles may reach far beyond it."""
    low = np.min([frame.x.min(axis=0) for frame in frames], axis=0)
    high = np.max([frame.x.max(axis=0) for frame in frames], axis=0)
    margin = 0.08 * (high - low).max()
    return low - margin, high + margin


class PlaneDrawing:
    """Bodies in the plane, by matplotlib."""

    def __init__(self, box, norm):
        self.box, self.norm = box, norm
        size = box[1] - box[0]
        self.is_wide = size[0] > 1.5 * size[1]
        self.width = 9 if self.is_wide else 4.2
        self.height = 0.87 * self.width * size[1] / size[0] + 0.4

    def draw(self, axes, frame):
        # An obstacle from triangles comes as its boundary edges: grey lines, heavier than the mesh.
        axes.add_collection(LineCollection(frame.obstacle_x[frame.obstacle_edges], colors="0.35", linewidths=1.8))
        axes.add_collection(PolyCollection(frame.outlines(), array=frame.values, cmap=COLOURS, norm=self.norm,
                                           edgecolors="0.1", linewidths=0.25))
        axes.set_aspect("equal")
        axes.set_xlim(self.box[0][0], self.box[1][0])
        axes.set_ylim(self.box[0][1], self.box[1][1])
        axes.tick_params(labelsize=7)


class SolidDrawing:
    """Solid bodies, by VTK."""

    is_wide, width, height = False, 5, 5.2

    def __init__(self, box, norm, options):
        self.norm = norm
        self.cut = (np.array(options.cut[:3]), options.cut[3]) if options.cut else None
        self.images = SolidImages(box, (PANEL_PIXELS, PANEL_PIXELS), options.view, options.zoom)

    def draw(self, axes, frame):
        colours = plt.get_cmap(COLOURS)(self.norm(frame.values))[:, :3]
        axes.imshow(self.images.image(frame, colours, self.cut))
        axes.set_axis_off()


def make_drawing(frames, options):
    box, norm = common_box(frames), common_norm(frames, is_logarithmic(options.field), options.range)
    return PlaneDrawing(box, norm) if frames[0].dim == 2 else SolidDrawing(box, norm, options)


def draw(drawing, axes, frame):
    for artist in [*axes.collections, *axes.images]:
        artist.remove()
    drawing.draw(axes, frame)
    axes.set_title(f"step {frame.step}, t = {frame.t:.4g} {frame.time_unit}: {frame.nodes()}, {len(frame.cells)} cells", fontsize=9)


def make_figure(drawing, frames, options, count):
    """A figure with one row or one column of panels, whichever is nearer to a page."""
    rows, columns = (count, 1) if drawing.is_wide else (1, count)
    figure, axes = plt.subplots(rows, columns, figsize=(drawing.width * columns + 1, drawing.height * rows), squeeze=False,
                                constrained_layout=True)
    figure.colorbar(ScalarMappable(drawing.norm, COLOURS), ax=list(axes.ravel()), label=label(frames, options.field), shrink=0.8)
    return figure, axes.ravel()


def label(frames, field):
    unit = frames[0].unit
    return field.replace("_", " ") + (f" [{unit}]" if unit else "")


def is_logarithmic(field):
    return field == "elastic_density"


def render_picture(frames, path, options):
    drawing = make_drawing(frames, options)
    figure, axes = make_figure(drawing, frames, options, len(frames))
    for panel, frame in zip(axes, frames):
        draw(drawing, panel, frame)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=150)
    plt.close(figure)


def render_animation(frames, path, options):
    """The layout is found once: frame after frame only what moves is drawn."""
    drawing = make_drawing(frames, options)
    figure, (axes,) = make_figure(drawing, frames, options, 1)
    figure.set_dpi(ANIMATION_DPI)
    draw(drawing, axes, frames[0])
    figure.canvas.draw()
    figure.set_layout_engine("none")
    pictures = []
    for frame in frames:
        draw(drawing, axes, frame)
        figure.canvas.draw()
        picture = Image.fromarray(np.asarray(figure.canvas.buffer_rgba())).convert("RGB")
        pictures.append(picture.quantize(64, dither=Image.Dither.NONE))
    path.parent.mkdir(parents=True, exist_ok=True)
    pictures[0].save(path, save_all=True, append_images=pictures[1:], duration=round(1000 / options.fps), loop=0)
    plt.close(figure)


FORCE_KINDS = ("contact", "friction", "reaction", "all")


def read_forces(folder):
    """Name -> column -> values over time, of forces.csv."""
    path = folder / "forces.csv"
    if not path.exists():
        raise SystemExit(f"{path}: not there; expected a run of a scene with /output/forces (docs/scenes.md)")
    curves = {}
    with open(path, newline="") as file:
        for row in csv.DictReader(file):
            curve = curves.setdefault(row.pop("name"), {})
            for column, value in row.items():
                curve.setdefault(column, []).append(float(value))
    return curves


def render_forces(folder, names, path):
    """A panel a curve and direction: each kind of force over time."""
    curves = read_forces(folder)
    with h5py.File(next(iter(frame_paths(folder).values())), "r") as file:
        units = units_of(file)
    absent = [name for name in names if name not in curves]
    if absent:
        raise SystemExit(f"--forces: no curve {absent[0]} in {folder}; there are {', '.join(curves)}")
    names = names or list(curves)
    directions = [c.removeprefix("all_") for c in curves[names[0]] if c in ("all_x", "all_y", "all_z")]
    figure, axes = plt.subplots(len(names), len(directions), figsize=(4.2 * len(directions), 2.8 * len(names)),
                                squeeze=False, constrained_layout=True)
    for row, name in zip(axes, names):
        for panel, direction in zip(row, directions):
            for kind in FORCE_KINDS:
                values = np.array(curves[name][f"{kind}_{direction}"])
                if kind == "all" or values.any():
                    style = {"color": "black", "linewidth": 1.6} if kind == "all" else {"linewidth": 1, "linestyle": "--"}
                    panel.plot(curves[name]["t"], values, label=kind, **style)
            panel.set_title(f"{name}, {direction}", fontsize=9)
            panel.set_xlabel(f"t [{units[2]}]", fontsize=8)
            panel.set_ylabel(f"force [{force_unit(*units)}]", fontsize=8)
            panel.grid(alpha=0.3)
            panel.legend(fontsize=7)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=150)
    plt.close(figure)


def numbers(count):
    def parse(text):
        values = [float(part) for part in text.split(",")]
        if len(values) != count:
            raise argparse.ArgumentTypeError(f"'{text}': expected {count} numbers")
        return values

    return parse


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("results", type=pathlib.Path)
    parser.add_argument("-o", "--output", type=pathlib.Path, help="default: RESULTS/picture.png")
    parser.add_argument("--frames", help="steps to show, as i,j,k")
    parser.add_argument("--animation", type=pathlib.Path, help="a .gif of all stored steps")
    parser.add_argument("--field", default="elastic_density", help="dataset of /fields that colours cells")
    parser.add_argument("--range", type=numbers(2), metavar="LOW,HIGH", help="of the colours; default: percentiles 1 and 99")
    parser.add_argument("--forces", nargs="?", const="", metavar="NAME,...", help="plots forces.csv instead")
    parser.add_argument("--fps", type=int, default=15, help="of the animation")
    parser.add_argument("--view", type=numbers(3), default=[0.55, 0.35, 1], metavar="X,Y,Z",
                        help="3D: from the bodies to the camera")
    parser.add_argument("--zoom", type=float, default=1, help="3D: above 1 nearer")
    parser.add_argument("--cut", type=numbers(4), metavar="X,Y,Z,D",
                        help="3D: leaves out cells whose middle at rest, p, has (X,Y,Z).p > D")
    options = parser.parse_args()

    if options.forces is not None:
        output = options.output or options.results / "forces.png"
        render_forces(options.results, [name for name in options.forces.split(",") if name], output)
        return print(output)
    paths = frame_paths(options.results)
    if Frame(next(iter(paths.values())), options.field).dim == 3:
        ensure_display()
    if options.animation:
        stride = -(-len(paths) // MAX_ANIMATION_FRAMES)
        render_animation([Frame(paths[step], options.field) for step in sorted(paths)[::stride]], options.animation, options)
        print(options.animation)
    if options.output or not options.animation:
        output = options.output or options.results / "picture.png"
        chosen = choose_frames(options.results, paths, options.frames)
        render_picture([Frame(paths[step], options.field) for step in chosen], output, options)
        print(output)


if __name__ == "__main__":
    main()
