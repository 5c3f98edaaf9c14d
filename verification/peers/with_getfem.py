# SPDX-License-Identifier: MIT
"""Problems by GetFEM (Debian's python3-getfem), in a process of its own: contact by an augmented Lagrangian, with rigid planes by
its formula, between bodies by GetFEM's brick for large sliding, which casts rays.

usage: with_getfem.py FOLDER, which has problem.pickle and gets curves.json
"""
import json
import pathlib
import pickle
import sys

import numpy as np

from problem import value_at

SECTIONS = {"axisymmetric": "2*pi*X(1)*"}


def write(problem, folder, order, settings):
    """Settings: `steps`, their number; `augmentation`; `release`, the largest distance of rays."""
    plain = {key: value for key, value in vars(problem).items() if key != "measure"}
    (folder / "problem.pickle").write_bytes(pickle.dumps((plain, order, settings, problem.dim)))


def command(_, folder):
    return ["/usr/bin/python3", __file__, str(folder)]


def read(problem, folder):
    stored = json.loads((folder / "curves.json").read_text())
    return {key: np.array(v) for key, v in stored["curves"].items()}, stored["iterations"], stored["steps"]


def stress(material, u, section, dim):
    """The virtual work of a body, for GetFEM's language of forms."""
    E, nu = material["E"], material["nu"]
    mu, lam, K = E / 2 / (1 + nu), E * nu / (1 + nu) / (1 - 2 * nu), E / 3 / (1 - 2 * nu)
    axis = section == "axisymmetric"
    G, w = f"Grad_{u}", SECTIONS.get(section, "")
    hoop, test_hoop = f"({u}(1)/X(1))", f"(Test_{u}(1)/X(1))"
    if material["type"] == "LinearElasticity":
        trace = f"(Trace({G})" + (f"+{hoop})" if axis else ")")
        work = f"({lam}*{trace}*Trace(Grad_Test_{u})+{mu}*(({G}+{G}'):Grad_Test_{u})"
        work += f"+({lam}*{trace}+{2 * mu}*{hoop})*{test_hoop})" if axis else ")"
        return w + work
    F = f"(Id({dim})+{G})"
    if material["type"] == "SaintVenant":
        green = f"(0.5*({F}'*{F}-Id({dim})))"
        return w + f"(({F}*({lam}*Trace({green})*Id({dim})+{2 * mu}*{green})):Grad_Test_{u})"
    third = f"(1+{hoop})" if axis else "1"
    J = f"(Det({F})*{third})"
    first = f"(Norm_sqr({F})+sqr({third}))" if dim == 2 else f"Norm_sqr({F})"
    power = f"pow({J},-2/3)"
    around = f"({mu}*{power}*{first}/3-{K}*({J}-1)*{J})"
    work = f"(({mu}*{power}*{F}-{around}*(Inv({F})')):Grad_Test_{u}"
    work += f"+({mu}*{power}*{third}-{around}/{third})*{test_hoop})" if axis else ")"
    return w + work


class Host:
    def __init__(self, gf, problem, order, settings, dim):
        self.gf, self.problem, self.dim, self.settings = gf, problem, dim, settings
        self.model, self.fields, self.methods, self.works, self.regions = gf.Model("real"), [], [], [], 0
        self.stiffness = min(b.material["E"] for b in problem["bodies"])
        for k, body in enumerate(problem["bodies"]):
            mesh = gf.Mesh("empty", dim)
            mesh.add_convex(gf.GeoTrans(f"GT_PK({dim},1)"), body.points[body.cells].transpose(2, 1, 0))
            field = gf.MeshFem(mesh, dim)
            field.set_fem(gf.Fem(f"FEM_PK({dim},{order})"))
            self.fields.append((mesh, field))
            self.methods.append(gf.MeshIm(mesh, gf.Integ("IM_TRIANGLE(4)" if dim == 2 else "IM_TETRAHEDRON(3)")))
            self.model.add_fem_variable(f"u{k}", field)
            self.works.append(stress(body.material, f"u{k}", problem["section"], dim))
            self.model.add_nonlinear_term(self.methods[k], self.works[k])
        self.order = order
        for body, shift in settings.get("nudge", {}).items():  # of bodies that only contact holds: they begin in contact
            field = self.fields[int(body)][1]
            self.model.set_variable(f"u{body}", np.tile(shift, field.nbdof() // dim))
        self.hold()
        self.load()
        self.touch()

    def region(self, body, box):
        """The facets of the boundary in a box."""
        self.regions += 1
        mesh, points, cells = self.fields[body][0], self.problem["bodies"][body].points, self.problem["bodies"][body].cells
        of_first = list(mesh.pid_from_cvid(0)[0])
        local = [[of_first.index(n) for n in mesh.pid_in_faces([[0], [f]])] for f in range(self.dim + 1)]
        faces = mesh.outer_faces()
        middle = points[cells[faces[0][:, None], np.array(local)[faces[1]]]].mean(axis=1)
        faces = faces[:, ((middle >= np.array(box[0])) & (middle <= np.array(box[1]))).all(axis=1)]
        assert faces.size, f"no facets of body {body} in {box}"
        mesh.set_region(self.regions, faces)
        return self.regions

    def hold(self):
        self.held = []
        for k, held in enumerate(self.problem["held"]):
            region, u = self.region(held.body, held.box), f"u{held.body}"
            self.model.add_initialized_data(f"move{k}", np.zeros(self.dim))
            # A spring this stiff gives way by about 1e-5 of what the body's own elements do.
            stiff = 1e5 * self.problem["bodies"][held.body].material["E"]
            for axis in held.values:
                work = f"{stiff}*({u}({axis + 1})-move{k}({axis + 1}))*Test_{u}({axis + 1})"
                self.model.add_nonlinear_term(self.methods[held.body], work, region)
            self.held.append(region)

    def load(self):
        for k, load in enumerate(self.problem["loads"]):
            self.model.add_initialized_data(f"traction{k}", np.zeros(self.dim))
            weight = SECTIONS.get(self.problem["section"], "")
            self.model.add_linear_term(self.methods[load.body], f"-{weight}traction{k}.Test_u{load.body}",
                                       self.region(load.body, load.box))

    def touch(self):
        gf, model, dim = self.gf, self.model, self.dim
        model.add_initialized_data("r", self.settings.get("augmentation", 10.0) * self.stiffness)
        model.add_initialized_data("f", self.problem["friction"])
        model.add_initialized_data("alpha", 1.0)
        self.before = []
        for k, contact in enumerate(self.problem["contacts"]):
            mesh, field = self.fields[contact.slave]
            region = self.region(contact.slave, contact.box)
            u, lam = f"u{contact.slave}", f"lam{k}"
            pressures = gf.MeshFem(mesh, dim)
            pressures.set_fem(gf.Fem(f"FEM_PK({dim},{self.settings.get('multipliers', self.order)})"))
            model.add_filtered_fem_variable(lam, pressures, region)
            model.add_fem_data(f"w{k}", field)
            self.before.append((f"w{k}", u))
            if contact.master is None:
                self.touch_plane(contact, region, u, lam, f"w{k}")
                continue
            model.add_fem_data(f"v{k}", self.fields[contact.master][1])
            self.before.append((f"v{k}", f"u{contact.master}"))
            brick = model.add_integral_large_sliding_contact_brick_raytracing("r", self.settings["release"], "f", "alpha", 0)
            model.add_slave_contact_boundary_to_large_sliding_contact_brick(brick, self.methods[contact.slave], region, u, lam, f"w{k}")
            model.add_master_contact_boundary_to_large_sliding_contact_brick(
                brick, self.methods[contact.master], self.region(contact.master, contact.master_box), f"u{contact.master}", f"v{k}")

    def touch_plane(self, contact, region, u, lam, before):
        """The tractions of the plane by their projection onto Coulomb's cone."""
        out = "[0,-1]" if self.dim == 2 else "[0,0,-1]"
        gap = f"((X+{u}).(-{out}))"
        cone = f"Coulomb_friction_coupled_projection({lam},{out},({u}-{before}),{gap},f,r)"
        weight = SECTIONS.get(self.problem["section"], "")
        self.model.add_nonlinear_term(self.methods[contact.slave],
                                      f"-{weight}{cone}.Test_{u}-{weight}(1/r)*({lam}-{cone}).Test_{lam}", region)

    def at(self, t):
        for k, held in enumerate(self.problem["held"]):
            self.model.set_variable(f"move{k}", np.array([value_at(held.values.get(a, 0.0), t) for a in range(self.dim)]))
        for k, load in enumerate(self.problem["loads"]):
            self.model.set_variable(f"traction{k}", np.array(load.traction) * t)

    def curves(self):
        found = {}
        for name, (index, axis) in self.problem["reactions"].items():
            body = self.problem["held"][index].body
            forces = self.gf.asm("generic", self.methods[body], 1, self.works[body], -1, self.model)
            first, count = self.model.interval_of_variable(f"u{body}")
            nodes = self.fields[body][1].basic_dof_on_region(self.held[index])
            own = np.asarray(forces).ravel()[first:first + count]
            found[name] = float(own[[n for n in nodes if n % self.dim == axis]].sum())
        for name, (body, at, axis) in self.problem["points"].items():
            field = self.fields[body][1]
            place = field.basic_dof_nodes()
            near = np.linalg.norm(place.T - np.array(at), axis=1)
            chosen = [n for n in np.argsort(near)[:self.dim] if n % self.dim == axis][0]
            found[name] = float(self.model.variable(f"u{body}")[chosen])
        return found

    def solve(self, t):
        self.at(t)
        most = self.settings.get("most", 40)
        nits, converged = self.model.solve("max_res", self.settings.get("residual", 1e-8), "max_iter", most, "lsolver", "mumps",
                                           "lsearch", self.settings.get("search", "simplest"), "alpha min", 0.5)
        return int(nits), bool(converged)


def run(folder):
    import getfem as gf
    gf.util("trace level", 0)
    problem, order, settings, dim = pickle.loads((folder / "problem.pickle").read_bytes())
    host = Host(gf, problem, order, settings, dim)
    curves, t, iterations, steps = {"t": []}, 0.0, 0, 0
    length = problem["tend"] / settings["steps"]
    names = [f"u{k}" for k in range(len(problem["bodies"]))] + [f"lam{k}" for k in range(len(problem["contacts"]))]
    while t < problem["tend"] - 1e-9:
        start = {name: host.model.variable(name).copy() for name in names}
        step = min(length, problem["tend"] - t)
        nits, converged = host.solve(t + step)
        iterations += nits
        if not converged:
            for name, value in start.items():
                host.model.set_variable(name, value)
            length /= 2
            if length < problem["tend"] / settings["steps"] / 50:
                raise SystemExit(f"no solution at t = {t + step:.5g}")
            continue
        t, steps, length = t + step, steps + 1, min(2 * length, problem["tend"] / settings["steps"])
        for data, u in host.before:
            host.model.set_variable(data, host.model.variable(u))
        curves["t"].append(t)
        for name, value in host.curves().items():
            curves.setdefault(name, []).append(value)
    (folder / "curves.json").write_text(json.dumps({"curves": curves, "iterations": iterations, "steps": steps}) + "\n")


if __name__ == "__main__":
    run(pathlib.Path(sys.argv[1]))
