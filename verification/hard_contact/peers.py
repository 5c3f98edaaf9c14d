#!/usr/bin/python3
# SPDX-License-Identifier: MIT
"""Runs CalculiX (ccx) or GetFEM (python3-getfem) on the scenes that this script can say to them.

python3 verification/hard_contact/peers.py calculix|getfem SCENES RESULTS [--scene PART-OF-NAME]... [--limit SECONDS] [--again]

Said are scenes on a fixed mesh, without friction, with obstacles that are planes across an axis, moved as a whole, and held vertices
that move alike; for GetFEM of one body. Both codes let surfaces overlap by pressure / STIFFNESS.
"""
import argparse
import itertools
import json
import pathlib
import resource
import subprocess
import sys
import tempfile
import time

import numpy as np

HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))
import score  # noqa: E402

VERSIONS = {"calculix": "2.20", "getfem": "5.4.2"}  # of Debian 12, with which this was written
# Stiffness of contact, by Young's modulus and by the length of a body's edge; CalculiX' impacts do not converge with more.
STIFFNESS = {"calculix": 50, "getfem": 1000}


def is_uniform(expressions):
    return all(e is None or not set("xyz") & set(str(e).replace("max", "").replace("exp", "")) for e in expressions)


def reason_against(scene, code):
    """Why a scene is not said to a code; empty where it is."""
    about = scene.about
    if about["mesh_may_change"]:
        return "the same as its twin on a fixed mesh"
    if about["contact"] and about["friction"]:
        return "friction"
    for number in range(1, len(about["obstacles"]) + 1):
        points = scene.obstacle_points[scene.obstacle == number]
        flat = np.ptp(points, axis=0) == 0
        beyond = (points.min(axis=0) < scene.points.min(axis=0)) & (points.max(axis=0) > scene.points.max(axis=0))
        if flat.sum() != 1 or not (flat | beyond).all() or not len(scene.edges if scene.dim == 2 else scene.faces):
            return "obstacles that are no planes, or not beyond all bodies"
    if not all(is_uniform(row["displacement"] or [0]) for row in about["held"] + about["obstacles"]):
        return "motion that is not uniform"
    if code == "calculix" and scene.dim == 2 and not scene.quasistatic:
        return "plane elements, whose printed velocities are not those of their displacements"
    if code == "getfem" and len(about["bodies"]) > 1 and about["contact"]:
        return "several bodies"
    return ""


def young(body):
    return body["mu"] * (3 * body["lambda"] + 2 * body["mu"]) / (body["lambda"] + body["mu"])


def contact_stiffness(scene, code):
    """Pressure by depth, of the softest body."""
    edge = np.linalg.norm(np.ptp(scene.points[scene.simplices], axis=1), axis=1).mean()
    return STIFFNESS[code] * min(map(young, scene.about["bodies"])) / edge


def times(scene):
    dt, end = scene.about["time"]["dt"], scene.about["time"]["end"]
    return dt * np.arange(1, round(end / dt) + 1)


def value(expression, t):
    return float(score.displacement([expression], np.zeros((1, 1)), t)[0, 0])


def plane(scene, number):
    """(axis, place, direction to the bodies) of an obstacle."""
    points = scene.obstacle_points[scene.obstacle == number]
    axis = int(np.flatnonzero(np.ptp(points, axis=0) == 0)[0])
    return axis, points[0, axis], 1.0 if scene.points[:, axis].mean() > points[0, axis] else -1.0


# --- CalculiX ------------------------------------------------------------------------------------------------------------

# Numbers of faces of linear elements by their corners.
FACES = {2: [(0, 1), (1, 2), (2, 0)], 3: [(0, 1, 2), (0, 1, 3), (1, 2, 3), (0, 2, 3)]}


def wall(scene, number, first):
    """Nodes of one element behind a plane, with the plane as the face of its first nodes."""
    axis, place, side = plane(scene, number)
    low, high = scene.points.min(axis=0) - scene.extent, scene.points.max(axis=0) + scene.extent
    others = [k for k in range(scene.dim) if k != axis]
    ring = [(0,), (1,)] if scene.dim == 2 else [(0, 0), (1, 0), (1, 1), (0, 1)]
    front = np.empty((len(ring), scene.dim))
    for row, corner in zip(front, ring):
        row[axis] = place
        row[others] = [high[k] if c else low[k] for k, c in zip(others, corner)]
    back = front - side * scene.extent * np.eye(scene.dim)[axis]
    nodes = np.concatenate([front, back[::-1] if scene.dim == 2 else back])
    edges = nodes[[1, 3, 4] if scene.dim == 3 else [1, 3]] - nodes[0]
    if np.linalg.det(edges) < 0:  # the same face from its other end
        order = [1, 0, 3, 2] if scene.dim == 2 else [0, 3, 2, 1, 4, 7, 6, 5]
        nodes = nodes[order]
    return nodes, first + np.arange(len(nodes))


def deck(scene, is_direct):
    """Lines of the input file; direct: all increments are dt."""
    about, d = scene.about, scene.dim
    walls = []
    for number in range(1, len(about["obstacles"]) + 1):
        walls.append(wall(scene, number, len(scene.points) + 1 + sum(len(nodes) for nodes, _ in walls)))
    points = np.concatenate([scene.points, *(nodes for nodes, _ in walls)])
    lines = ["*NODE, NSET=ALL"] + [f"{n}, " + ", ".join(f"{c:.15g}" for c in (*p, *[0.0] * (3 - d))) for n, p in enumerate(points, 1)]
    for b, body in enumerate(about["bodies"], 1):
        mine = np.flatnonzero(scene.body == b)
        lines += [f"*ELEMENT, TYPE={'CPE3' if d == 2 else 'C3D4'}, ELSET=BODY{b}"]
        lines += [f"{k + 1}, " + ", ".join(str(v + 1) for v in scene.simplices[k]) for k in mine]
        # Another law than the scene's: equal to it for small strains (CalculiX 2.20 has NaN of *HYPERFOAM, which would be closer).
        bulk = body["lambda"] + 2 / 3 * body["mu"]
        lines += [f"*MATERIAL, NAME=BODY{b}", "*HYPERELASTIC, NEO HOOKE", f"{body['mu'] / 2:.12g}, {2 / bulk:.12g}",
                  "*DENSITY", f"{body['rho']}", f"*SOLID SECTION, ELSET=BODY{b}, MATERIAL=BODY{b}", "1" if d == 2 else ""]
        facets = {tuple(sorted(f)) for f in score.boundary(scene.simplices[mine])}
        lines += [f"*SURFACE, NAME=SKIN{b}"] + [f"{k + 1}, S{face}" for k in mine for face, corners in enumerate(FACES[d], 1)
                                                if tuple(sorted(scene.simplices[k][list(corners)])) in facets]
    for number, (_, ids) in enumerate(walls, 1):
        element = len(scene.simplices) + number
        lines += [f"*ELEMENT, TYPE={'CPE4' if d == 2 else 'C3D8'}, ELSET=WALL{number}", f"{element}, " + ", ".join(map(str, ids)),
                  f"*SOLID SECTION, ELSET=WALL{number}, MATERIAL=BODY1", "1" if d == 2 else "",
                  f"*SURFACE, NAME=WALL{number}", f"{element}, S1", f"*NSET, NSET=WALL{number}"] + [f"{n}," for n in ids]
    if about["contact"]:
        lines += ["*SURFACE INTERACTION, NAME=TOUCH", "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR",
                  f"{contact_stiffness(scene, 'calculix'):.6g}"]
        skins = [f"SKIN{b}" for b in scene.bodies]
        pairs = [(skin, f"WALL{k}") for skin in skins for k in range(1, len(walls) + 1)] + list(itertools.combinations(skins, 2))
        for pair in pairs:
            lines += ["*CONTACT PAIR, INTERACTION=TOUCH, TYPE=SURFACE TO SURFACE", ", ".join(pair)]
    return lines + conditions(scene, [ids for _, ids in walls], is_direct)


def conditions(scene, walls, is_direct):
    about, d = scene.about, scene.dim
    groups = [([n + 1 for n in row["nodes"]], row["displacement"]) for row in about["held"]]
    groups += [(ids, obstacle["displacement"] or [0.0] * d) for ids, obstacle in zip(walls, about["obstacles"])]
    lines, boundary = [], []
    for g, (nodes, expressions) in enumerate(groups):
        for axis, expression in enumerate(expressions):
            if expression is None:
                continue
            name = f"A{g}{'XYZ'[axis]}"
            lines += [f"*AMPLITUDE, NAME={name}"] + [f"{t:.12g}, {value(expression, t):.12g}" for t in (0.0, *times(scene))]
            boundary += [f"*BOUNDARY, AMPLITUDE={name}"] + [f"{n}, {axis + 1}, {axis + 1}, 1" for n in nodes]
    lines += ["*AMPLITUDE, NAME=FULL", f"0, 1, {times(scene)[-1]:.12g}, 1"]
    moving = [(b, k, v) for b, body in enumerate(about["bodies"], 1) for k, v in enumerate(body["velocity"], 1) if v]
    if moving:
        lines += ["*INITIAL CONDITIONS, TYPE=VELOCITY"]
        lines += [f"{n + 1}, {k}, {v:.12g}" for b, k, v in moving for n in np.unique(scene.simplices[scene.body == b])]
    kind = ("*STATIC" if scene.quasistatic else "*DYNAMIC") + (", DIRECT" if is_direct else "")
    dt, end = about["time"]["dt"], about["time"]["end"]
    bounds = "" if is_direct else f", {1e-4 * dt:.12g}, {dt:.12g}"
    lines += ["*STEP, NLGEOM, INC=100000", kind, f"{dt:.12g}, {end:.12g}{bounds}", *boundary]
    if scene.gravity.any():
        lines += ["*DLOAD, AMPLITUDE=FULL"] + [f"BODY{b}, GRAV, {-scene.gravity[1]:.12g}, 0, -1, 0" for b in scene.bodies]
    lines += ["*NODE PRINT, NSET=ALL", "U" if scene.quasistatic else "U, V"]
    for number in range(1, len(walls) + 1):
        lines += [f"*NODE PRINT, NSET=WALL{number}, TOTALS=ONLY", "RF"]
    return lines + ["*END STEP"]


def read_dat(path, scene):
    """(times, u, v, forces on obstacles) of what is printed."""
    blocks, now = [], None
    for line in path.read_text().splitlines():
        words = line.split()
        if "time" in words:
            now = (words[0], words[words.index("set") + 1] if "set" in words else "", float(words[-1]), [])
            blocks.append(now)
        elif now is not None and words:
            now[3].append([float(word) for word in words])
    n, d = len(scene.points), scene.dim
    fields = {name: {t: np.array(rows)[:n, 1:1 + d] for kind, _, t, rows in blocks if kind == name}
              for name in ("displacements", "velocities")}
    found = sorted(fields["displacements"])
    forces = {}
    for _, of, t, rows in (block for block in blocks if block[0] == "total"):
        # Forces that hold the wall balance those of the bodies.
        forces.setdefault("obstacle" + of.removeprefix("WALL"), {})[t] = [-f for f in rows[0]]
    return (found, [fields["displacements"][t] for t in found], [fields["velocities"].get(t) for t in found],
            {name: [series.get(t) for t in found] for name, series in forces.items()})


def run_calculix(scene, limit):
    """With increments of dt, and where these do not come to the end, with such as CalculiX chooses."""
    result = run_ccx(scene, limit, is_direct=True)
    return result if result[0] and result[0][-1] >= times(scene)[-1] * (1 - 1e-6) else run_ccx(scene, limit, is_direct=False)


def run_ccx(scene, limit, is_direct):
    with tempfile.TemporaryDirectory() as scratch:
        job = pathlib.Path(scratch) / "job"
        job.with_suffix(".inp").write_text("\n".join(deck(scene, is_direct)) + "\n")
        done = subprocess.run(["prlimit", f"--cpu={limit:.0f}", "ccx", "-i", "job"], cwd=scratch, capture_output=True, text=True)
        notes = f"ended by signal {-done.returncode}, at most {limit:.0f} s" if done.returncode < 0 else ""
        notes = next((line.strip() for line in done.stdout.splitlines() if "*ERROR" in line), notes)
        if not job.with_suffix(".dat").exists():
            return [], [], [], {}, 0, notes or "no output"
        found, u, v, forces = read_dat(job.with_suffix(".dat"), scene)
        rows = [line.split() for line in job.with_suffix(".sta").read_text().splitlines()] if job.with_suffix(".sta").exists() else []
        iterations = sum(int(row[3]) for row in rows if len(row) > 3 and row[0].isdigit())
    return found, u, v, forces, iterations, notes


# --- GetFEM ----------------------------------------------------------------------------------------------------------------

def mesh_of(gf, scene):
    mesh = gf.Mesh("empty", scene.dim)
    mesh.add_point(scene.points.T)
    for cell in scene.simplices:
        mesh.add_convex(gf.GeoTrans(f"GT_PK({scene.dim},1)"), scene.points[cell].T)
    mesh.set_region(1, mesh.outer_faces())
    return mesh


def nodes_of(mf, scene):
    """Number of each degree of freedom's vertex, and its axis."""
    places = mf.basic_dof_nodes().T
    vertex = np.array([np.abs(scene.points - place).sum(axis=1).argmin() for place in places])
    return vertex, np.arange(len(places)) % scene.dim


def getfem_model(gf, scene, mf, mim):
    """Strain, weight, inertia of implicit Euler (`ahead`: where vertices would go without forces), and contact, in weak form."""
    d, dt = scene.dim, scene.about["time"]["dt"]
    cells = gf.MeshFem(mf.linked_mesh(), 1)
    cells.set_fem(gf.Fem(f"FEM_PK({d},0)"))
    cell_of = cells.basic_dof_nodes().T
    middles = scene.points[scene.simplices].mean(axis=1)
    order = [np.abs(middles - place).sum(axis=1).argmin() for place in cell_of]
    md = gf.Model("real")
    md.add_fem_variable("u", mf)
    md.add_fem_data("ahead", mf)
    for name in ("mu", "lambda", "rho"):
        md.add_initialized_fem_data(name, cells, scene.field(name, scene.body)[order].astype(float))
    md.add_initialized_data("g", scene.gravity)
    F = f"(Id({d})+Grad_u)"
    md.add_nonlinear_term(mim, f"(mu*({F}-Inv({F})')+lambda*log(Det({F}))*Inv({F})'):Grad_Test_u - rho*g.Test_u")
    if not scene.quasistatic:
        md.add_nonlinear_term(mim, f"{1 / dt**2!r}*rho*(u-ahead).Test_u")
    stiff = contact_stiffness(scene, "getfem")
    for k, (axis, _, side) in enumerate(planes_of(scene)):
        md.add_initialized_data(f"place{k}", [0.0])
        i = axis + 1
        md.add_nonlinear_term(mim, f"{-stiff * side!r}*pos_part({side}*(place{k}-X({i})-u({i})))*Test_u({i})", 1)
    return md


def planes_of(scene):
    return [plane(scene, k) for k in range(1, len(scene.about["obstacles"]) + 1)] if scene.about["contact"] else []


def push(scene, mf, mim, gf, md, k):
    """Force of the bodies on a plane."""
    axis, _, side = planes_of(scene)[k]
    depth = f"pos_part({side}*(place{k}-X({axis + 1})-u({axis + 1})))"
    force = np.zeros(scene.dim)
    force[axis] = -side * contact_stiffness(scene, "getfem") * gf.asm_generic(mim, 0, depth, 1, md)
    return force.tolist()


def run_getfem(scene, limit):
    import getfem as gf
    gf.util_trace_level(0)
    about, d, dt, started = scene.about, scene.dim, scene.about["time"]["dt"], time.process_time()
    mesh = mesh_of(gf, scene)
    mf, mim = gf.MeshFem(mesh, d), gf.MeshIm(mesh, gf.Integ(f"IM_{'TRIANGLE' if d == 2 else 'TETRAHEDRON'}(2)"))
    mf.set_fem(gf.Fem(f"FEM_PK({d},1)"))
    vertex, axis_of = nodes_of(mf, scene)
    if len(vertex) != scene.points.size:
        return [], [], [], {}, 0, "GetFEM makes one of vertices that are near each other"
    md = getfem_model(gf, scene, mf, mim)
    held = {(n, axis): e for row in about["held"] for n in row["nodes"] for axis, e in enumerate(row["displacement"]) if e is not None}
    fixed = [(dof, held[v, a]) for dof, (v, a) in enumerate(zip(vertex, axis_of)) if (v, a) in held]
    if fixed:
        rows = gf.Spmat("empty", len(fixed), mf.nbdof())
        for row, (dof, _) in enumerate(fixed):
            rows.add(row, dof, 1.0)
        md.add_variable("holding", len(fixed))
        brick = md.add_constraint_with_multipliers("u", "holding", rows, np.zeros(len(fixed)))
    body_of = np.zeros(len(scene.points), dtype=int)
    body_of[scene.simplices] = scene.body[:, None]
    u = np.zeros(mf.nbdof())
    v = np.array([about["bodies"][body_of[n] - 1]["velocity"][a] for n, a in zip(vertex, axis_of)], dtype=float)
    by_vertex = lambda values: values[np.lexsort((axis_of, vertex))].reshape(-1, d)  # noqa: E731
    found, us, vs, iterations, notes = [0.0], [by_vertex(u)], [by_vertex(v)], 0, ""
    forces = {f"obstacle{k + 1}": [[0.0] * d] for k in range(len(planes_of(scene)))}
    residual = 1e-13 * contact_stiffness(scene, "getfem") * scene.extent**d
    for t in times(scene):
        for k, (axis, place, _) in enumerate(planes_of(scene)):
            moved = about["obstacles"][k]["displacement"]
            md.set_variable(f"place{k}", [place + (value(moved[axis], t) if moved else 0.0)])
        md.set_variable("ahead", u + dt * v)
        if fixed:
            md.set_private_rhs(brick, np.array([value(e, t) for _, e in fixed]))
        try:
            taken, converged = md.solve("max_res", residual, "max_iter", 200, "lsearch", "simplest")
        except RuntimeError:  # a matrix that cannot be inverted
            taken, converged = 0, False
        iterations += taken
        new = md.variable("u")
        if not converged or time.process_time() - started > limit:
            notes = f"no solution at t = {t:g}" if not converged else f"stopped after {limit:g} s"
            break
        u, v = new, (new - u) / dt
        found.append(t)
        us.append(by_vertex(u))
        vs.append(by_vertex(v))
        for k, series in enumerate(forces.values()):
            series.append(push(scene, mf, mim, gf, md, k))
    return found, us, vs, forces, iterations, notes


# --- both -----------------------------------------------------------------------------------------------------------------------

def processor_seconds():
    return sum(usage.ru_utime + usage.ru_stime for usage in map(resource.getrusage, (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)))


def run(scene, folder, code, limit):
    before = processor_seconds()
    found, u, v, forces, iterations, notes = {"calculix": run_calculix, "getfem": run_getfem}[code](scene, limit)
    folder.mkdir(parents=True, exist_ok=True)
    result = {"code": {"calculix": "CalculiX", "getfem": "GetFEM"}[code], "version": VERSIONS[code],
              "seconds": processor_seconds() - before, "iterations": iterations, "notes": notes, "forces": forces}
    if found and found[0] > 0:  # the start is not printed
        body_of = np.zeros(len(scene.points), dtype=int)
        body_of[scene.simplices] = scene.body[:, None]
        start = np.array([scene.about["bodies"][b - 1]["velocity"] for b in body_of], dtype=float)
        found, u, v = [0.0, *found], [np.zeros_like(scene.points), *u], [start, *v]
        result["forces"] = {name: [[0.0] * scene.dim, *series] for name, series in forces.items()}
    if found:
        speeds = {} if scene.quasistatic or any(x is None for x in v) else {"v": np.array(v)}
        np.savez_compressed(folder / "frames.npz", t=found, rest=scene.points, x=scene.points + np.array(u), simplices=scene.simplices,
                            body=scene.body, **speeds)
    (folder / "result.json").write_text(json.dumps(result) + "\n")
    return result


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("code", choices=("calculix", "getfem"))
    parser.add_argument("scenes", type=pathlib.Path)
    parser.add_argument("results", type=pathlib.Path)
    parser.add_argument("--scene", action="append")
    parser.add_argument("--limit", type=float, default=60, help="of processor time of a run [s]")
    parser.add_argument("--again", action="store_true")
    options = parser.parse_args()
    for folder in sorted(path.parent for path in options.scenes.glob("*/scene.json")):
        if options.scene and not any(part in folder.name for part in options.scene):
            continue
        scene = score.Scene(folder)
        reason = reason_against(scene, options.code)
        if reason or ((options.results / folder.name / "result.json").exists() and not options.again):
            print(f"{folder.name}: not run, {reason or 'has a result'}", flush=True)
            continue
        result = run(scene, options.results / folder.name, options.code, options.limit)
        print(f"{folder.name}: {result['seconds']:.2f} s, {result['iterations']} iterations {result['notes']}", flush=True)


if __name__ == "__main__":
    main()
