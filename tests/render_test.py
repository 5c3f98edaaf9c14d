# SPDX-License-Identifier: MIT
"""examples/render.py draws runs: pictures by any field, an animation of all frames, and it says which fields there are.

usage: render_test.py ITR EXAMPLES
"""

import pathlib
import subprocess
import sys
import tempfile
import types

import h5py
import numpy
from PIL import Image


def check_colours(examples, frame):
    """What colours a cell: its value, or the mean of its vertices' magnitudes."""
    sys.path.insert(0, str(examples))
    from render import Frame

    with h5py.File(frame) as file:
        cells = file["/mesh/simplices"][:]
        speed = numpy.linalg.norm(file["/fields/v"][:], axis=1)
        stress = file["/fields/von_mises"][:]
    assert stress.max() > 0
    numpy.testing.assert_array_equal(Frame(frame, "von_mises").values, stress)
    numpy.testing.assert_allclose(Frame(frame, "v").values, [speed[cell].mean() for cell in cells])
    assert (Frame(frame, "v").unit, Frame(frame, "von_mises").unit) == ("m/s", "Pa")


def check_lengths_in_space(examples):
    """A unit has one length along all three axes (Gauss: the squares of its projections, as complex numbers, sum to 0)."""
    from matplotlib.colors import LogNorm
    from mpl_toolkits.mplot3d import proj3d
    from render import draw, make_axes

    corners = numpy.array([[0, 0, 0], [4, 0, 0], [0, 2, 0], [0, 0, 1]], float)
    frame = types.SimpleNamespace(dim=3, step=0, t=0, x=corners, cells=[[0, 1, 2, 3]], obstacle_faces=[],
                                  polygons=lambda: (corners[None, :3], numpy.ones(1)))
    box = corners.min(axis=0), corners.max(axis=0)
    axes = make_axes([frame], box, 1)[1][0]
    draw(axes, frame, LogNorm(0.1, 1), box)
    axes.set_proj_type("ortho")
    x, y, _ = proj3d.proj_transform(*numpy.vstack([numpy.zeros(3), numpy.eye(3)]).T, axes.get_proj())
    units = (x[1:] - x[0]) + 1j * (y[1:] - y[0])
    assert abs((units**2).sum()) < 1e-9 * (abs(units)**2).sum(), units


def main():
    itr, examples = sys.argv[1], pathlib.Path(sys.argv[2])
    with tempfile.TemporaryDirectory() as scratch:
        folder = pathlib.Path(scratch)
        command = [itr, "run", examples / "ball_wall.json", "-o", folder / "run", "--threads", "1"]
        for text in ("/time/tend=0.0002", "/output/paraview/options/scalar_values=true"):
            command += ["--set", text]
        subprocess.run(command, check=True, capture_output=True)
        stored = sorted((folder / "run/frames").glob("*.h5"))
        frames = len(stored)
        assert frames > 3, frames
        check_colours(examples, stored[-1])
        check_lengths_in_space(examples)

        def render(*arguments, status=0):
            done = subprocess.run([sys.executable, examples / "render.py", folder / "run", *arguments], capture_output=True,
                                  text=True)
            assert done.returncode == status, done.stderr
            return done.stderr

        render("-o", folder / "speed.png", "--field", "v")
        with Image.open(folder / "speed.png") as picture:
            assert len(picture.convert("RGB").getcolors(maxcolors=1 << 24)) > 100, "an empty picture"
        render("--animation", folder / "all.gif")
        with Image.open(folder / "all.gif") as animation:
            assert animation.n_frames == frames, (animation.n_frames, frames)
        message = render("--field", "pressure", status=1)
        assert "no field pressure; there are" in message and "von_mises" in message, message


if __name__ == "__main__":
    main()
