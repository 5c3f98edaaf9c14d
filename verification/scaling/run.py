#!/usr/bin/python3
# SPDX-License-Identifier: MIT
"""How the cost of a direct factorisation grows with the unknowns and falls with the ranks: analyses of growing elastic
bodies give fill and flops, MUMPS gives its memory a rank, power laws are fitted to both, and from them the size at which a
machine's memory is full. Writes results.csv, model.json, scaling.svg and tables.md. Nothing here is a time.

/usr/bin/python3 verification/scaling/run.py [--build build/release] [--work DIR] [--most UNKNOWNS] [--memory GIB]
"""
import argparse
import csv
import itertools
import json
import os
import pathlib
import subprocess
import sys

import numpy
import scipy.sparse

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parent.parent
sys.path.insert(0, str(HERE.parent))
from harness import stored  # noqa: E402
ENVIRONMENT = dict(os.environ, OMPI_ALLOW_RUN_AS_ROOT="1", OMPI_ALLOW_RUN_AS_ROOT_CONFIRM="1",
                   OMPI_MCA_rmaps_base_oversubscribe="1", OMPI_MCA_mpi_yield_when_idle="1")
SIZES = {2: (20, 40, 80, 160, 320, 440), 3: (6, 9, 13, 19, 25, 31, 43)}  # cells along an edge of the square, of the cube
RANKS = (1, 2, 4)
# solver and options of the analyses
MUMPS = ("mumps:spd", ["ordering=scotch"])
ANALYSES = [("cholmod:supernodal", ["ordering=amd"]), ("cholmod:supernodal", ["ordering=metis"]), MUMPS]
KEYS = ["dim", "unknowns", "nonzeros", "solver", "options", "ranks", "what", "factor_nonzeros", "flops", "factor_mb",
        "largest_rank_mb", "residual", "outcome", "commit"]


def simplices(dim, cells):
    """Points (one a row) and simplices of the unit square or cube in cells^dim boxes, each cut along its diagonal (Kuhn)."""
    side = cells + 1
    grid = numpy.stack(numpy.meshgrid(*[numpy.arange(side)] * dim, indexing="ij"), -1).reshape(-1, dim)
    stride = side ** numpy.arange(dim - 1, -1, -1)
    corners = (grid[(grid < cells).all(1)] * stride).sum(1)
    paths = [numpy.cumsum([0, *stride[list(order)]]) for order in itertools.permutations(range(dim))]
    return grid / cells, numpy.concatenate([corners[:, None] + path for path in paths])


def elasticity(points, cells):
    """Stiffness plus mass of linear elements, lambda = mu = 1 and rho = 1, dof = dim * vertex + component."""
    dim = points.shape[1]
    edges = (points[cells[:, 1:]] - points[cells[:, :1]]).transpose(0, 2, 1)
    volume = numpy.abs(numpy.linalg.det(edges)) / (2 if dim == 2 else 6)
    gradients = numpy.empty((len(cells), dim + 1, dim))
    gradients[:, 1:] = numpy.linalg.inv(edges)
    gradients[:, 0] = -gradients[:, 1:].sum(1)
    identity = numpy.eye(dim)
    local = (numpy.einsum("eai,ebj->eaibj", gradients, gradients) + numpy.einsum("eaj,ebi->eaibj", gradients, gradients) +
             numpy.einsum("eak,ebk,ij->eaibj", gradients, gradients, identity))
    mass = (numpy.ones((dim + 1, dim + 1)) + numpy.eye(dim + 1)) / ((dim + 1) * (dim + 2))
    local = (local + numpy.einsum("ab,ij->aibj", mass, identity)) * volume[:, None, None, None, None]
    dofs = (dim * cells[:, :, None] + numpy.arange(dim)).reshape(len(cells), -1)
    width = dofs.shape[1]
    rows, columns = numpy.repeat(dofs, width, 1).ravel(), numpy.tile(dofs, (1, width)).ravel()
    return scipy.sparse.coo_matrix((local.ravel(), (rows, columns)), (dim * len(points),) * 2).tocsc()


def write_system(folder, dim, cells):
    """A system as `itr_dump_systems` leaves it (verification/solvers/dump.hpp)."""
    if (folder / "block_size.npy").exists():
        return
    points, mesh = simplices(dim, cells)
    lower = scipy.sparse.tril(elasticity(points, mesh), format="csc")
    lower.sort_indices()
    folder.mkdir(parents=True, exist_ok=True)
    n = lower.shape[0]
    save = lambda name, values, kind: numpy.save(folder / f"{name}.npy", numpy.ascontiguousarray(values, dtype=kind))
    save("starts", lower.indptr, numpy.int32)
    save("rows", lower.indices, numpy.int32)
    save("values", lower.data, numpy.float64)
    save("rhs", numpy.random.default_rng(1).standard_normal(n), numpy.float64)
    save("dofs", numpy.arange(n), numpy.int32)
    save("coordinates", numpy.repeat(points, dim, 0).ravel(), numpy.float64)
    save("block_size", [dim], numpy.int32)


def bench(program, folder, solver, options, ranks, seconds):
    command = ["mpirun", "-n", str(ranks)] * (ranks > 1) + [str(program), str(folder), solver, *options]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=seconds, env=ENVIRONMENT, check=False)
    except subprocess.TimeoutExpired:
        return {"outcome": f"did not finish in {seconds:g} s"}
    if done.returncode != 0:
        return {"outcome": f"ended with status {done.returncode}: {done.stderr.strip().splitlines()[-1:]}"}
    return json.loads(done.stdout.splitlines()[-1])


def fit(unknowns, values):
    """Factor and exponent of the power law through the upper half of the sizes, where the asymptote is nearer."""
    pairs = sorted(zip(unknowns, values))[len(unknowns) // 2:]
    exponent, factor = numpy.polyfit(*numpy.log(numpy.array(pairs, dtype=float)).T, 1)
    return float(numpy.exp(factor)), float(exponent)


def model(rows, memory):
    """Power laws of fill, flops and bytes for each dimension and solver, and the unknowns that fill `memory` bytes."""
    laws = []
    for dim in SIZES:
        for solver, options, ranks in dict.fromkeys((r["solver"], r["options"], r["ranks"]) for r in rows):
            some = [r for r in rows if (r["dim"], r["solver"], r["options"], r["ranks"], r["what"], r["outcome"]) ==
                    (dim, solver, options, ranks, "analysis", "ok")]
            if len(some) < 4:
                continue
            n = [r["unknowns"] for r in some]
            law = {"dim": dim, "solver": solver, "options": options, "ranks": ranks}
            for key in ("factor_nonzeros", "flops", "factor_mb", "largest_rank_mb"):
                law[key] = fit(n, [r[key] for r in some])
            factor, exponent = law["factor_mb"]
            law["unknowns_that_fill_the_memory"] = float((memory / 1e6 / factor) ** (1 / exponent))
            law["flops_there"] = law["flops"][0] * law["unknowns_that_fill_the_memory"] ** law["flops"][1]
            laws.append(law)
    return laws


def tables(rows, laws, memory):
    power = lambda law: f"{law[0]:.3g} n^{law[1]:.2f}"
    lines = [f"| | solver | ranks | entries of the factor | flops | MB, all ranks | MB, largest rank | n at {memory / 2**30:g} GiB | "
             "flops there |", "|---|---|---|---|---|---|---|---|---|"]
    for law in laws:
        lines.append(f"| {law['dim']}D | {law['solver']} {law['options']} | {law['ranks']} | {power(law['factor_nonzeros'])} | "
                     f"{power(law['flops'])} | {power(law['factor_mb'])} | {power(law['largest_rank_mb'])} | "
                     f"{law['unknowns_that_fill_the_memory']:.2g} | {law['flops_there']:.1e} |")
    lines += ["", "| | unknowns | solver | ranks | | entries, 10⁶ | flops | MB, all ranks | MB, largest rank | outcome; residual |",
              "|---|---|---|---|---|---|---|---|---|---|"]
    for r in rows:
        figures = ("", "", "", "") if r["outcome"] != "ok" else (
            f"{r['factor_nonzeros'] / 1e6:.3g}", f"{r['flops']:.2e}", f"{r['factor_mb']:.4g}", f"{r['largest_rank_mb']:.4g}")
        residual = f"; {r['residual']:.0e}" if r["what"] == "factorisation" and r["outcome"] == "ok" else ""
        lines.append(f"| {r['dim']}D | {r['unknowns']} | {r['solver']} {r['options']} | {r['ranks']} | {r['what']} | "
                     + " | ".join(figures) + f" | {r['outcome']}{residual} |")
    return "\n".join(lines) + "\n"


def plot(rows, laws, file):
    import matplotlib
    matplotlib.use("Agg")
    from matplotlib import pyplot

    matplotlib.rcParams["svg.hashsalt"] = "itr"
    figure, axes = pyplot.subplots(1, 3, figsize=(15, 4.5))
    for axis, key, title in zip(axes, ("factor_nonzeros", "flops", "largest_rank_mb"),
                                ("entries of the factor", "flops of the factorisation", "MB of the largest rank")):
        for i, law in enumerate(laws):
            if key != "largest_rank_mb" and law["ranks"] > 1:
                continue
            points = sorted((r["unknowns"], r[key]) for r in rows if r["what"] == "analysis" and r["outcome"] == "ok" and
                            all(r[name] == law[name] for name in ("dim", "solver", "options", "ranks")))
            n = numpy.array([points[0][0], 3 * points[-1][0]])
            axis.loglog(*zip(*points), "osd^v<>*xp"[i % 10], color=f"C{i % 10}",
                        label=f"{law['dim']}D {law['solver']} {law['options']} {law['ranks']} rank(s)")
            axis.loglog(n, law[key][0] * n ** law[key][1], "-" if law["dim"] == 3 else "--", color=f"C{i % 10}", linewidth=0.8)
        axis.set_title(title)
        axis.set_xlabel("unknowns")
        axis.grid(alpha=0.3)
    axes[2].legend(fontsize=6)
    figure.tight_layout()
    figure.savefig(file, metadata={"Date": None})


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--build", type=pathlib.Path, default=ROOT / "build" / "release")
    parser.add_argument("--work", type=pathlib.Path, default=ROOT / "results" / "scaling", help="for systems")
    parser.add_argument("--most", type=int, default=400_000, help="larger systems are left out")
    parser.add_argument("--factorize", type=int, default=100_000, help="the largest 3D system up to here is factorised too")
    parser.add_argument("--seconds", type=float, default=180, help="an analysis or factorisation has")
    parser.add_argument("--memory", type=float, default=24, help="of a machine [GiB]")
    parser.add_argument("--output", type=pathlib.Path, default=HERE)
    arguments = parser.parse_args()
    program = arguments.build / "bin" / "itr_solver_bench"
    rows = []

    def run(dim, unknowns, folder, solver, options, ranks, what):
        flag = "--analyze" if what == "analysis" else "--once"
        row = bench(program, folder, solver, [flag, *options], ranks, arguments.seconds)
        row = {"dim": dim, "unknowns": unknowns, **row, "solver": solver, "options": " ".join(options), "ranks": ranks, "what": what}
        rows.append(row)
        print(json.dumps(row), flush=True)

    for dim, sizes in SIZES.items():
        there = []
        for cells in sizes:
            unknowns = dim * (cells + 1) ** dim
            if unknowns > arguments.most:
                continue
            folder = arguments.work / f"{dim}d-{cells}"
            write_system(folder, dim, cells)
            there.append((unknowns, folder))
            for solver, options in ANALYSES:
                for ranks in RANKS if solver.startswith("mumps") else [1]:
                    run(dim, unknowns, folder, solver, options, ranks, "analysis")
        if dim == 3:
            unknowns, folder = max(system for system in there if system[0] <= arguments.factorize)
            for ranks in RANKS:
                run(dim, unknowns, folder, *MUMPS, ranks, "factorisation")

    memory = arguments.memory * 2**30
    laws = model(rows, memory)
    arguments.output.mkdir(parents=True, exist_ok=True)
    with open(arguments.output / "results.csv", "w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, KEYS, extrasaction="ignore")
        writer.writeheader()
        writer.writerows({**row, "commit": stored.made("verification/scaling/results.csv")} for row in rows)
    (arguments.output / "model.json").write_text(json.dumps(laws, indent=1) + "\n", encoding="utf-8")
    text = tables(rows, laws, memory)
    (arguments.output / "tables.md").write_text(text, encoding="utf-8")
    plot(rows, laws, arguments.output / "scaling.svg")
    print(text)
    return 0


if __name__ == "__main__":
    sys.exit(main())
