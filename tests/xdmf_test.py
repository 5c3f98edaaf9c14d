# SPDX-License-Identifier: MIT
"""Opens the series of short runs with the reader of meshio and compares it with the frames.

usage: xdmf_test.py ITR EXAMPLES
"""

import pathlib
import subprocess
import sys
import tempfile
import xml.etree.ElementTree as ElementTree

import h5py
import meshio
import numpy

ASKED = ("contact_forces", "friction_forces", "reaction_forces", "scalar_values", "tensor_values")
CELLS = {2: "triangle", 3: "tetra"}
QUADRATIC = {2: "triangle6", 3: "tetra10"}


def run(itr, scene, directory, sets):
    command = [itr, "run", scene, "-o", directory, "--threads", "1"]
    for text in sets + ["/output/paraview/vtu=true"] + [f"/output/paraview/options/{name}=true" for name in ASKED]:
        command += ["--set", text]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def items(grid):
    """Every attribute and its data item."""
    for attribute in grid.findall("Attribute"):
        yield attribute, attribute.find("DataItem")


def read_item(directory, item):
    name, dataset = item.text.strip().split(":")
    with h5py.File(directory / name) as file:
        values = file[dataset][()]
    return values.reshape(tuple(int(n) for n in item.get("Dimensions").split()))


def check_attributes(directory, frames):
    """Every attribute of every grid: its data are there, with the shape that it says."""
    root = ElementTree.parse(directory / "sim.xdmf").getroot()
    grids = root.findall("./Domain/Grid/Grid")
    assert len(grids) == len(frames), (len(grids), len(frames))
    for grid, frame in zip(grids, frames):
        with h5py.File(frame) as file:
            assert float(grid.find("Time").get("Value")) == file.attrs["t"]
            names = {attribute.get("Name") for attribute, _ in items(grid)}
            for field in file["fields"]:
                assert field == "x" or field in names, (field, names)
            sizes = {"Node": len(file["drawn/x" if "drawn" in file else "fields/x"]), "Cell": len(file["mesh/body"])}
        for attribute, item in items(grid):
            assert len(read_item(directory, item)) == sizes[attribute.get("Center")], attribute.get("Name")


def check_middles(mesh, file, dim):
    """The node of each drawn edge is that of the curved edge, or else the mean of its ends."""
    if "curved_edges" not in file["mesh"]:
        return
    x, edges = file["fields/x"][()], file["mesh/curved_edges"][()]
    curved = {tuple(edge): x[len(x) - len(edges) + i] for i, edge in enumerate(edges.tolist())}
    order = [(0, 1), (1, 2), (0, 2)] + [(0, 3), (1, 3), (2, 3)] * (dim == 3)
    for block in mesh.cells:
        for cell in block.data.tolist() if block.type == QUADRATIC[dim] else []:
            for node, (i, j) in zip(cell[dim + 1 :], order):
                ends = tuple(sorted((cell[i], cell[j])))
                expected = curved.get(ends, (x[ends[0]] + x[ends[1]]) / 2)
                assert numpy.array_equal(mesh.points[node, :dim], expected), (node, ends)


def check_meshio(directory, frames):
    """meshio reads the mesh and the arrays of each step."""
    tree = ElementTree.parse(directory / "sim.xdmf")
    for number, frame in enumerate(frames):
        single = ElementTree.fromstring('<Xdmf Version="3.0"><Domain/></Xdmf>')
        grid = tree.getroot().findall("./Domain/Grid/Grid")[number]
        grid.remove(grid.find("Time"))
        single.find("Domain").append(grid)
        path = directory / "single.xdmf"
        ElementTree.ElementTree(single).write(path)
        mesh = meshio.read(path)
        with h5py.File(frame) as file:
            drawn = file["drawn" if "drawn" in file else "fields"]
            x = drawn["x"][()]
            dim = x.shape[1]
            assert numpy.array_equal(mesh.points[:, :dim], x)
            corners = numpy.concatenate([block.data[:, : dim + 1] for block in mesh.cells])
            kinds = {block.type for block in mesh.cells}
            if "curved_edges" not in file["mesh"]:
                assert kinds == {CELLS[dim]}, kinds
            else:
                assert kinds == {QUADRATIC[dim]}, kinds
            for name in ("von_mises", "body"):
                values = numpy.concatenate(mesh.cell_data[name])
                assert numpy.array_equal(values, file["fields" if name == "von_mises" else "mesh"][name][()])
            assert numpy.array_equal(corners, file["mesh/simplices"][()])
            for name in ("u", "v", "contact_force", "friction_force", "reaction_force"):
                if name in file["fields"]:
                    assert numpy.array_equal(mesh.point_data[name], drawn[name][()]), name
                if name in file["fields"] and name.endswith("_force"):
                    nodes = len(file["fields/x"])
                    assert numpy.array_equal(mesh.point_data[name][:nodes], file["fields"][name][()]), name
                    assert not mesh.point_data[name][nodes:].any(), name
            stress = numpy.concatenate(mesh.cell_data["stress"])
            assert numpy.array_equal(stress.ravel(), file["fields/stress"][()].ravel())
            check_middles(mesh, file, dim)
    return mesh


def check_vtu(directory, frames):
    """meshio reads vtu/NNNNNN.vtu, in space."""
    series = ElementTree.parse(directory / "sim.pvd").findall("./Collection/DataSet")
    assert [entry.get("file") for entry in series] == [f"vtu/{frame.stem}.vtu" for frame in frames]
    for frame, entry in zip(frames, series):
        mesh = meshio.read(directory / entry.get("file"))
        with h5py.File(frame) as file:
            assert float(entry.get("timestep")) == file.attrs["t"]
            drawn = file["drawn" if "drawn" in file else "fields"]
            x = drawn["x"][()]
            dim = x.shape[1]
            assert numpy.array_equal(mesh.points[:, :dim], x) and not mesh.points[:, dim:].any()
            kind = QUADRATIC[dim] if "curved_edges" in file["mesh"] else CELLS[dim]
            cells = file["mesh/quadratic_cells" if "curved_edges" in file["mesh"] else "mesh/simplices"][()]
            assert numpy.array_equal(mesh.cells_dict[kind], cells)
            assert numpy.array_equal(mesh.point_data["u"][:, :dim], drawn["u"][()])
            for name in ("contact_force", "friction_force", "reaction_force"):
                if name in drawn:
                    assert numpy.array_equal(mesh.point_data[name][:, :dim], drawn[name][()]), name
            assert numpy.array_equal(mesh.cell_data["von_mises"][0].ravel(), file["fields/von_mises"][()])
            stress = mesh.cell_data["stress"][0].reshape(-1, 3, 3)[:, :dim, :dim]
            assert numpy.array_equal(stress.ravel(), file["fields/stress"][()].ravel())


def main(itr, examples):
    examples = pathlib.Path(examples)
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        (folder / "tet.msh").write_text(
            "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n4\n1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n$EndNodes\n"
            "$Elements\n1\n1 4 2 1 1 1 2 3 4\n$EndElements\n"
        )
        (folder / "tet.json").write_text(
            '{"geometry": [{"mesh": "tet.msh"}], "materials": {"type": "NeoHookean", "E": 1e5, "nu": 0.3, "rho": 1000},'
            '"boundary_conditions": {"rhs": [0, 9.81, 0]}, "time": {"dt": 0.01, "time_steps": 3}}'
        )
        (folder / "two.msh").write_text(
            "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n5\n1 0 0 0\n2 1 0 0\n3 1 1 0\n4 0 1 0\n5 -1 0.5 0\n$EndNodes\n"
            "$Elements\n3\n1 2 2 1 1 1 2 3\n2 2 2 2 1 1 3 4\n3 2 2 2 1 1 4 5\n$EndElements\n"
        )
        (folder / "two.json").write_text(
            '{"geometry": [{"mesh": "two.msh"}], "materials": [{"id": 1, "type": "NeoHookean", "E": 1e5, "nu": 0.3, "rho": 1000},'
            '{"id": 2, "type": "NeoHookean", "E": 1e4, "nu": 0.3, "rho": 1000}],'
            '"initial_conditions": {"velocity": [{"id": 1, "value": ["y * y", "x"]}]},'
            '"time": {"dt": 0.01, "time_steps": 3}}'
        )
        runs = {
            "masticator": (examples / "masticator.json", ['/time={"dt":0.05,"time_steps":12}']),
            "tet": (folder / "tet.json", []),
            "quadratic tet": (folder / "tet.json", ["/space/discr_order=2"]),
            "quadratic square": (folder / "two.json", ["/space/discr_order=2"]),
            "mixed square": (folder / "two.json", ['/space/discr_order=[{"id":1,"order":2}]']),
            "mixed and held": (folder / "two.json", [
                '/space/discr_order=[{"id":1,"order":2}]', "/geometry/0/surface_selection=3",
                '/boundary_conditions={"rhs":[0,9.81],"dirichlet_boundary":[{"id":3,"value":[0,0]}]}']),
        }
        for name, (scene, sets) in runs.items():
            directory = folder / name
            run(itr, scene, directory, sets)
            frames = sorted((directory / "frames").glob("*.h5"))
            assert len(frames) == (13 if name == "masticator" else 4), len(frames)
            check_attributes(directory, frames)
            mesh = check_meshio(directory, frames)
            check_vtu(directory, frames)
            if name == "mixed and held":
                assert mesh.point_data["reaction_force"].any()
            if name == "tet":
                assert mesh.cell_data["stress"][0].shape[-1] in (3, 9)
                assert mesh.point_data["reaction_force"].shape == (4, 3)
            print(f"{name}: {len(frames)} grids, last with {len(mesh.points)} points")


if __name__ == "__main__":
    main(*sys.argv[1:])
