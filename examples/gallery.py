#!/usr/bin/python3
# SPDX-License-Identifier: MIT
"""Cuts single panels out of the pictures of runs and shrinks them, for the gallery in README.

usage: gallery.py                     writes examples/gallery/*.png
       gallery.py PICTURE OUT.png     shrinks one picture to a width of 1300 pixels
"""

import pathlib
import sys

import numpy as np
from PIL import Image

ROOT = pathlib.Path(__file__).resolve().parent.parent
PAPER = "verification/paper"
PANELS = {  # name -> picture, panel as shares of its width and height: left, top, right, bottom
    "masticator-2d": ("examples/masticator.png", (0.094, 0.358, 0.857, 0.642)),
    "masticator-3d": (f"{PAPER}/masticator-3d/bodies.png", (0.370, 0.05, 0.555, 1)),
    "rollers-3d": (f"{PAPER}/rollers/bodies.png", (0.312, 0.05, 0.467, 1)),
    "spikes-3d": (f"{PAPER}/spikes3d/bodies.png", (0.555, 0.05, 0.740, 1)),
}
SIZE = 480  # of a gallery picture, pixels
WIDTH = 1300  # of a shrunk picture
COLOURS = 128


def panel(path, box):
    """One panel without its title, cut down to what is drawn, on a white square."""
    picture = Image.open(path).convert("RGB")
    part = picture.crop([round(share * size) for share, size in zip(box, picture.size * 2)])
    drawn = (np.asarray(part) < 250).any(axis=2)
    rows, columns = np.flatnonzero(drawn.any(axis=1)), np.flatnonzero(drawn.any(axis=0))
    part = part.crop((columns[0], rows[0], columns[-1] + 1, rows[-1] + 1))
    square = Image.new("RGB", (max(part.size),) * 2, "white")
    square.paste(part, ((square.width - part.width) // 2, (square.height - part.height) // 2))
    return square.resize((SIZE, SIZE), Image.LANCZOS).quantize(COLOURS, dither=Image.NONE)


def main():
    if len(sys.argv) == 3:
        picture = Image.open(sys.argv[1]).convert("RGB")
        picture = picture.resize((WIDTH, round(picture.height * WIDTH / picture.width)), Image.LANCZOS)
        picture.quantize(COLOURS, dither=Image.NONE).save(sys.argv[2], optimize=True)
        return
    folder = ROOT / "examples/gallery"
    folder.mkdir(exist_ok=True)
    for name, (path, box) in PANELS.items():
        panel(ROOT / path, box).save(folder / f"{name}.png", optimize=True)


if __name__ == "__main__":
    main()
