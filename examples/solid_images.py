# SPDX-License-Identifier: MIT
"""Images of solid bodies by VTK, off screen: shaded, true to scale, with the edges of the mesh.

Debian's VTK draws through X: without a display it runs under xvfb-run (packages python3-vtk9, xvfb, xauth,
libgl1-mesa-dri)."""

import importlib.util
import os
import shutil
import sys

import numpy as np


CURVE_PARTS = 6  # straight pieces that a curved edge is drawn by
PACKAGES = "python3-vtk9, xvfb, xauth and libgl1-mesa-dri"


def ensure_display():
    """Starts this program anew under xvfb-run where there is no display; VTK would abort."""
    if not importlib.util.find_spec("vtkmodules"):
        raise SystemExit(f"solid bodies are drawn by VTK, which is not there; packages {PACKAGES}")
    if os.environ.get("DISPLAY"):
        return
    if not shutil.which("xvfb-run"):
        raise SystemExit(f"solid bodies: no display, and no xvfb-run to make one; packages {PACKAGES}")
    os.execvp("xvfb-run", ["xvfb-run", "-a", "-s", "-screen 0 640x480x24", sys.executable, *sys.argv])


def poly_data(points, polygons, as_lines=False):
    from vtkmodules.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray
    from vtkmodules.vtkCommonCore import vtkPoints
    from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPolyData
    places = vtkPoints()
    places.SetData(numpy_to_vtk(np.ascontiguousarray(points), deep=True))
    cells = vtkCellArray()
    offsets = np.arange(len(polygons) + 1, dtype=np.int64) * polygons.shape[1]
    cells.SetData(numpy_to_vtkIdTypeArray(offsets, deep=True),
                  numpy_to_vtkIdTypeArray(np.ascontiguousarray(polygons, np.int64).ravel(), deep=True))
    data = vtkPolyData()
    data.SetPoints(places)
    (data.SetLines if as_lines else data.SetPolys)(cells)
    return data


def curved_faces(frame, faces, owner):
    """Points, triangles, their owners and lines of edges; faces are cut into CURVE_PARTS^2 flat triangles where edges of the
    frame are curved (`middles`: their nodes by the ends), else taken as they are, without lines."""
    middles, parts = getattr(frame, "middles", None), CURVE_PARTS
    if not middles:
        return frame.x, faces, owner, None
    grid = [(i, j) for i in range(parts + 1) for j in range(parts + 1 - i)]
    index = {place: k for k, place in enumerate(grid)}
    cut = [(index[i, j], index[i + 1, j], index[i, j + 1]) for i, j in grid if i + j < parts]
    cut += [(index[i + 1, j], index[i + 1, j + 1], index[i, j + 1]) for i, j in grid if i + j < parts - 1]
    rim = [index[i, 0] for i in range(parts)] + [index[parts - j, j] for j in range(parts)]
    rim += [index[0, parts - j] for j in range(parts + 1)]
    u, v = np.array(grid).T / parts
    weights = (1 - u - v, u, v)
    points = []
    for face in faces.tolist():
        x = sum(w[:, None] * frame.x[n] for w, n in zip(weights, face))
        for i, j in ((0, 1), (1, 2), (0, 2)):
            a, b = sorted((face[i], face[j]))
            if (a, b) in middles:
                bulge = 4 * frame.x[middles[a, b]] - 2 * frame.x[a] - 2 * frame.x[b]
                x = x + (weights[i] * weights[j])[:, None] * bulge
        points.append(x)
    first = len(grid) * np.arange(len(faces))[:, None, None]
    return (np.concatenate(points), (first + np.array(cut)).reshape(-1, 3), np.repeat(owner, len(cut)),
            first[:, 0] + np.array(rim))


class SolidImages:
    """One view on a box, of `size` pixels; `direction` from the middle of the box to the camera, y is up."""

    def __init__(self, box, size, direction, zoom):
        import vtkmodules.vtkRenderingFreeType  # noqa: F401
        import vtkmodules.vtkRenderingOpenGL2  # noqa: F401
        from vtkmodules.vtkRenderingCore import vtkLightKit, vtkRenderer, vtkRenderWindow
        self.renderer, self.window = vtkRenderer(), vtkRenderWindow()
        self.window.SetOffScreenRendering(1)
        self.window.SetMultiSamples(8)
        self.window.SetSize(*size)
        self.window.AddRenderer(self.renderer)
        self.renderer.SetBackground(1, 1, 1)
        self.lights = vtkLightKit()
        self.lights.AddLightsToRenderer(self.renderer)
        low, high = box
        middle, direction = (low + high) / 2, np.asarray(direction, float)
        camera = self.renderer.GetActiveCamera()
        camera.SetFocalPoint(*middle)
        camera.SetPosition(*(middle + direction))
        camera.SetViewUp(*((0, 1, 0) if abs(direction[1]) < 0.99 * np.linalg.norm(direction) else (0, 0, -1)))
        self.renderer.ResetCamera(*np.column_stack([low, high]).ravel())
        camera.Zoom(1.3 * zoom)

    def image(self, frame, colours, cut=None):
        """Pixels of a frame, `colours` (RGB, 0 to 1) by cell; `cut` (normal, offset): cells beyond the plane are left out."""
        from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy
        from vtkmodules.vtkRenderingCore import vtkActor, vtkPolyDataMapper, vtkWindowToImageFilter
        self.renderer.RemoveAllViewProps()

        vtkPolyDataMapper.SetResolveCoincidentTopologyToPolygonOffset()  # lines on faces are seen whole

        def add(data):
            mapper, actor = vtkPolyDataMapper(), vtkActor()
            mapper.SetInputData(data)
            actor.SetMapper(mapper)
            self.renderer.AddActor(actor)
            return actor.GetProperty()

        kept = np.arange(len(frame.cells))
        if cut is not None:
            normal, offset = cut
            kept = kept[frame.rest[frame.cells].mean(axis=1) @ normal <= offset]
        faces, owner = frame.outer_faces(kept)
        points, faces, owner, outlines = curved_faces(frame, faces, owner)
        data = poly_data(points, faces)
        rgb = numpy_to_vtk(np.ascontiguousarray(255 * colours[owner], np.uint8), deep=True)
        data.GetCellData().SetScalars(rgb)
        look = add(data)
        if outlines is None:
            look.SetEdgeVisibility(True)
            look.SetEdgeColor(0.15, 0.15, 0.15)
            look.SetLineWidth(1)
        else:
            lines = add(poly_data(points, outlines, as_lines=True))
            lines.SetColor(0.15, 0.15, 0.15)
            lines.SetLighting(False)
        look.SetInterpolationToFlat()
        look.SetAmbient(0.3)
        if len(frame.obstacle_faces):
            look = add(poly_data(frame.obstacle_x, frame.obstacle_faces))
            look.SetColor(0.8, 0.83, 0.88)
            look.SetOpacity(0.35)
            look.SetEdgeVisibility(True)
            look.SetEdgeColor(0.5, 0.53, 0.58)
            look.SetInterpolationToFlat()
        self.renderer.ResetCameraClippingRange()
        self.window.Render()
        reader = vtkWindowToImageFilter()
        reader.SetInput(self.window)
        reader.ReadFrontBufferOff()
        reader.Update()
        picture = reader.GetOutput()
        width, height, _ = picture.GetDimensions()
        return vtk_to_numpy(picture.GetPointData().GetScalars()).reshape(height, width, -1)[::-1, :, :3]
