#!/usr/bin/python3
# SPDX-License-Identifier: MIT
"""Draws what `itr run` left in a folder: the deformed mesh, cells coloured by a field, obstacles in grey.

usage: render.py RESULTS [-o out.png] [--frames i,j,k] [--animation out.gif] [--field NAME]

Without --frames: the first stored step, the one with the largest elastic energy, and the last. NAME is any dataset of the
frames' /fields: of vectors and tensors the magnitude counts, of fields on vertices the mean of a cell's. Default:
elastic_density, on a logarithmic scale.
"""

import argparse
import json
import pathlib

import h5py
import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import LogNorm, Normalize
from mpl_toolkits.mplot3d.art3d import Poly3DCollection
from PIL import Image

DECADES = 5  # of energy density that the colours span below its maximum
MAX_ANIMATION_FRAMES = 150
ANIMATION_DPI = 90
UP = [2, 0, 1]  # order of the axes in 3D, where matplotlib draws the last one upwards: y is


class Frame:
    """One frames/NNNNNN.h5."""

    def __init__(self, path, field="elastic_density"):
        with h5py.File(path, "r") as file:
            if field not in file["/fields"]:
                raise SystemExit(f"{path}: no field {field}; there are {', '.join(file['/fields'])} (SCENES.md, "
                                 "/output/paraview/options, says how to ask for others)")
            self.step, self.t = int(file.attrs["step"]), float(file.attrs["t"])
            self.x = file["/fields/x"][:]
            self.cells = file["/mesh/simplices"][:]
            values = file["/fields"][field][:]
            self.unit = file["/fields"][field].attrs.get("unit", "")
            self.obstacle_x = file["/obstacles/x"][:]
            self.obstacle_edges = file["/obstacles/edges"][:]
            self.obstacle_faces = file["/obstacles/faces"][:]
        self.dim = self.x.shape[1]
        values = np.linalg.norm(values, axis=1) if values.ndim > 1 else values
        self.values = values if len(values) == len(self.cells) else values[self.cells].mean(axis=1)

    def polygons(self):
        """Corner positions of what is drawn, and its values: triangles of a plane mesh, boundary faces of a solid one."""
        if self.dim == 2:
            return self.x[self.cells], self.values
        faces = np.concatenate([np.delete(self.cells, k, axis=1) for k in range(4)])
        owner = np.tile(np.arange(len(self.cells)), 4)
        _, first, count = np.unique(np.sort(faces, axis=1), axis=0, return_index=True, return_counts=True)
        outer = first[count == 1]
        return self.x[faces[outer]], self.values[owner[outer]]


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


def common_norm(frames, is_logarithmic):
    largest = max((frame.values.max(initial=0) for frame in frames), default=0) or 1
    if not is_logarithmic:
        return Normalize(min(frame.values.min(initial=0) for frame in frames), largest)
    return LogNorm(largest / 10**DECADES, largest, clip=True)


def common_box(frames):
    """Smallest box around the bodies in all frames, with a margin; obstacles may reach far beyond it."""
    low = np.min([frame.x.min(axis=0) for frame in frames], axis=0)
    high = np.max([frame.x.max(axis=0) for frame in frames], axis=0)
    margin = 0.08 * (high - low).max()
    return low - margin, high + margin


def draw_plane(axes, frame, norm):
    # An obstacle from triangles comes as its boundary edges: grey lines, heavier than the mesh.
    axes.add_collection(LineCollection(frame.obstacle_x[frame.obstacle_edges], colors="0.35", linewidths=1.8))
    polygons, values = frame.polygons()
    cells = PolyCollection(polygons, array=values, cmap="YlOrRd", norm=norm, edgecolors="0.1", linewidths=0.25)
    axes.add_collection(cells)
    axes.set_aspect("equal")
    return cells


def draw_solid(axes, frame, norm):
    if len(frame.obstacle_faces):
        axes.add_collection3d(
            Poly3DCollection(frame.obstacle_x[frame.obstacle_faces][..., UP], facecolors=(0.6, 0.6, 0.6, 0.25)))
    polygons, values = frame.polygons()
    cells = Poly3DCollection(polygons[..., UP], cmap="YlOrRd", norm=norm, edgecolors="0.1", linewidths=0.2)
    cells.set_array(values)
    axes.add_collection3d(cells)
    return cells


def draw(axes, frame, norm, box):
    low, high = box
    cells = draw_plane(axes, frame, norm) if frame.dim == 2 else draw_solid(axes, frame, norm)
    if frame.dim == 3:
        low, high = low[UP], high[UP]
        axes.set_zlim(low[2], high[2])
        axes.set_box_aspect(high - low)
        axes.view_init(elev=20, azim=-30)
        for name, index in zip("xyz", UP):
            axes.set(**{f"{name}label": "xyz"[index]})
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    axes.set_title(f"step {frame.step}, t = {frame.t:.4g} s: {len(frame.x)} vertices, {len(frame.cells)} cells", fontsize=9)
    axes.tick_params(labelsize=7)
    return cells


def make_axes(frames, box, count):
    """A figure with one row or one column of panels, whichever is nearer to a page."""
    size = box[1] - box[0]
    is_wide = frames[0].dim == 2 and size[0] > 1.5 * size[1]
    rows, columns = (count, 1) if is_wide else (1, count)
    panel_width = 9 if is_wide else 4.2
    panel_height = 0.87 * panel_width * size[1] / size[0] + 0.4 if frames[0].dim == 2 else panel_width
    keywords = {"projection": "3d"} if frames[0].dim == 3 else {}
    figure, axes = plt.subplots(rows, columns, figsize=(panel_width * columns + 1, panel_height * rows), squeeze=False,
                                subplot_kw=keywords, constrained_layout=True)
    return figure, axes.ravel()


def label(frames, field):
    unit = frames[0].unit
    return field.replace("_", " ") + (f" [{unit}]" if unit else "")


def is_logarithmic(field):
    return field == "elastic_density"


def render_picture(frames, path, field):
    norm, box = common_norm(frames, is_logarithmic(field)), common_box(frames)
    figure, axes = make_axes(frames, box, len(frames))
    for panel, frame in zip(axes, frames):
        cells = draw(panel, frame, norm, box)
    figure.colorbar(cells, ax=list(axes), label=label(frames, field), shrink=0.8)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=150)
    plt.close(figure)


def render_animation(frames, path, frames_per_second, field):
    """The layout is found once: frame after frame only what moves is drawn, and taken off the canvas."""
    norm, box = common_norm(frames, is_logarithmic(field)), common_box(frames)
    figure, (axes,) = make_axes(frames, box, 1)
    figure.set_dpi(ANIMATION_DPI)
    figure.colorbar(draw(axes, frames[0], norm, box), ax=axes, label=label(frames, field))
    figure.canvas.draw()
    figure.set_layout_engine("none")
    pictures = []
    for frame in frames:
        for artist in list(axes.collections):
            artist.remove()
        draw(axes, frame, norm, box)
        figure.canvas.draw()
        picture = Image.fromarray(np.asarray(figure.canvas.buffer_rgba())).convert("RGB")
        pictures.append(picture.quantize(64, dither=Image.Dither.NONE))
    path.parent.mkdir(parents=True, exist_ok=True)
    pictures[0].save(path, save_all=True, append_images=pictures[1:], duration=round(1000 / frames_per_second), loop=0)
    plt.close(figure)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("results", type=pathlib.Path)
    parser.add_argument("-o", "--output", type=pathlib.Path, help="default: RESULTS/picture.png")
    parser.add_argument("--frames", help="steps to show, as i,j,k")
    parser.add_argument("--animation", type=pathlib.Path, help="a .gif of all stored steps")
    parser.add_argument("--field", default="elastic_density", help="dataset of /fields that colours cells")
    parser.add_argument("--fps", type=int, default=15, help="of the animation")
    arguments = parser.parse_args()

    paths = frame_paths(arguments.results)
    if arguments.animation:
        stride = -(-len(paths) // MAX_ANIMATION_FRAMES)
        frames = [Frame(paths[step], arguments.field) for step in sorted(paths)[::stride]]
        render_animation(frames, arguments.animation, arguments.fps, arguments.field)
        print(arguments.animation)
    if arguments.output or not arguments.animation:
        output = arguments.output or arguments.results / "picture.png"
        chosen = choose_frames(arguments.results, paths, arguments.frames)
        render_picture([Frame(paths[step], arguments.field) for step in chosen], output, arguments.field)
        print(output)


if __name__ == "__main__":
    main()
