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


def check_units(folder):
    """Pictures name the units of the frames."""
    import render

    for units, force in {("m", "kg", "s"): "N", ("mm", "t", "s"): "N", ("mm", "g", "ms"): "N", ("mm", "kg", "s"): "mN",
                         ("cm", "kg", "s"): "kg cm/s^2", ("in", "lb", "s"): "lb in/s^2"}.items():
        assert render.force_unit(*units) == force, units
    saved, texts = render.plt.Figure.savefig, []
    render.plt.Figure.savefig = lambda figure, *rest, **more: texts.extend(
        text for axes in figure.axes for text in (axes.get_title(), axes.get_xlabel(), axes.get_ylabel()))
    try:
        render.render_forces(folder, [], folder / "units.png")
        frames = [render.Frame(path) for path in sorted((folder / "frames").glob("*.h5"))[-1:]]
        render.render_picture(frames, folder / "units.png", types.SimpleNamespace(field="elastic_density", range=None))
    finally:
        render.plt.Figure.savefig = saved
    assert "t [ms]" in texts and "force [kN]" in texts, texts
    assert any(" ms: " in text for text in texts), texts


def check_orders(itr, examples, folder):
    """Order is 1 of cells with straight edges, 2 where all are curved."""
    from render import Frame

    for order in (1, 2):
        run = folder / f"order{order}"
        subprocess.run([itr, "run", examples / "cantilever.json", "-o", run, "--set", "/space/remesh/enabled=false", "--set",
                        f"/space/discr_order={order}", "--set", "/time/tend=0.1"], check=True, capture_output=True)
        assert set(Frame(sorted((run / "frames").glob("*.h5"))[-1], "order").values) == {order}


SCALE_CHECK = """
import sys, types
import numpy
sys.path.insert(0, sys.argv[1])
from solid_images import SolidImages, ensure_display
ensure_display()
corners = numpy.array([[0, 0, 0], [4, 0, 0], [0, 4, 0], [0, 0, 1], [4, 4, 1]], float)
faces = numpy.array([[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]])
frame = types.SimpleNamespace(x=corners, rest=corners, cells=numpy.array([[0, 1, 2, 3]]), obstacle_faces=[],
                              outer_faces=lambda kept: (faces, numpy.zeros(4, int)))
box = corners.min(axis=0), corners.max(axis=0)
image = SolidImages(box, (400, 400), [0, 0, 1], 1).image(frame, numpy.array([[1.0, 0, 0]]))
rows, columns = numpy.nonzero(image.min(axis=2) < 250)
print(numpy.ptp(rows), numpy.ptp(columns))
"""


def check_lengths_in_space(examples, scratch):
    """Seen from the front, a body that is as wide as high is drawn so."""
    program = scratch / "scale.py"
    program.write_text(SCALE_CHECK)
    done = subprocess.run([sys.executable, program, str(examples)], capture_output=True, text=True)
    if "packages" in done.stderr:
        print("skipped the pictures of solids:", done.stderr.strip())
        return
    assert done.returncode == 0, done.stderr
    high, wide = (int(word) for word in done.stdout.split())
    assert wide > 100 and abs(high - wide) <= 2, (high, wide)


def main():
    itr, examples = sys.argv[1], pathlib.Path(sys.argv[2])
    with tempfile.TemporaryDirectory() as scratch:
        folder = pathlib.Path(scratch)
        command = [itr, "run", examples / "ball_wall.json", "-o", folder / "run", "--threads", "1"]
        for text in ("/time/tend=0.0002", "/output/paraview/options/scalar_values=true",
                     '/geometry/1/name="wall"',
                     '/output/forces=[{"name": "wall", "obstacles": "wall"}, {"name": "ball", "bodies": 1}]'):
            command += ["--set", text]
        subprocess.run(command, check=True, capture_output=True)
        stored = sorted((folder / "run/frames").glob("*.h5"))
        frames = len(stored)
        assert frames > 3, frames
        check_colours(examples, stored[-1])
        subprocess.run([*command[:4], folder / "units", *command[5:], "--set", '/units={"mass": "g", "length": "m", "time": "ms"}', "--set",
                        "/time/dt=0.01", "--set", "/time/tend=0.02", "--set", "/initial_conditions/velocity/0/value=[0.067, 0]"], check=True, capture_output=True)
        check_units(folder / "units")
        check_orders(itr, examples, folder)
        check_lengths_in_space(examples, folder)

        def render(*arguments, status=0):
            done = subprocess.run([sys.executable, examples / "render.py", folder / "run", *arguments], capture_output=True,
                                  text=True)
            assert done.returncode == status, done.stderr
            return done.stderr

        render("-o", folder / "speed.png", "--field", "v", "--range", "0,40")
        render("--forces")
        render("--forces", "ball", "-o", folder / "ball.png")
        for name in ("run/forces.png", "ball.png"):
            with Image.open(folder / name) as picture:
                assert len(picture.convert("RGB").getcolors(maxcolors=1 << 24)) > 10, "an empty plot"
        assert "no curve door" in render("--forces", "door", status=1)
        with Image.open(folder / "speed.png") as picture:
            assert len(picture.convert("RGB").getcolors(maxcolors=1 << 24)) > 100, "an empty picture"
        render("--animation", folder / "all.gif")
        with Image.open(folder / "all.gif") as animation:
            assert animation.n_frames == frames, (animation.n_frames, frames)
        message = render("--field", "pressure", status=1)
        assert "no field pressure; there are" in message and "von_mises" in message, message


if __name__ == "__main__":
    main()
