# SPDX-License-Identifier: MIT
"""The library's own matrices and projections, through verification/tools/probe.cpp."""
import scipy.io

from harness.scenes import write_scene


def write_array(path, array):
    scipy.io.mmwrite(path, array, precision=17)


def matrices(context, name, content, u):
    """Mass and tangent (sparse), internal force, load at t = 1 (interleaved) and elastic energy of a scene at u."""
    folder = context.folder / name
    folder.mkdir()
    write_array(folder / "u.mtx", u)
    context.call("itr_probe", "matrices", write_scene(context, name, content), folder / "u.mtx", folder)
    read = {key: scipy.io.mmread(folder / f"{key}.mtx") for key in ("mass", "tangent", "force", "load", "energy")}
    return {"mass": read["mass"].tocsr(), "tangent": read["tangent"].tocsr(), "force": read["force"].ravel(),
            "load": read["load"].ravel(), "energy": float(read["energy"][0, 0])}


def project(context, name, old_scene, new_scene, field):
    """The L2 projection of a field (a row a vertex) from the mesh of one scene to that of another."""
    source, target = (context.folder / f"{name}-{kind}.mtx" for kind in ("old", "new"))
    write_array(source, field)
    context.call("itr_probe", "project", write_scene(context, f"{name}-from", old_scene),
                 write_scene(context, f"{name}-to", new_scene), source, target)
    return scipy.io.mmread(target)
