# SPDX-License-Identifier: MIT
"""`mpirun -n N itr run ... --solver mumps` (or belos:muelu): same result on all N, clean ends, one message for a mistake.

usage: mpi_test.py ITR SOURCE_DIR MPI_HOST
MPI_HOST is the program of mpi_host.cpp, which hands in communicators of its own.
Exit status 77 (skipped): no mpirun, or the solver mumps is absent.
"""

import json
import os
import pathlib
import shutil
import signal
import subprocess
import sys
import tempfile
import time

ITR, SOURCE, MPI_HOST = sys.argv[1:4]
SCENE = str(pathlib.Path(SOURCE) / "examples" / "masticator.json")
ENVIRONMENT = dict(os.environ, OMPI_ALLOW_RUN_AS_ROOT="1", OMPI_ALLOW_RUN_AS_ROOT_CONFIRM="1",
                   OMPI_MCA_rmaps_base_oversubscribe="1", OMPI_MCA_mpi_yield_when_idle="1")
PATIENCE = 1200  # s; a hang fails here, and ranks that wait for each other on a loaded machine do not


def mpirun(ranks, *command):
    return ["mpirun", "-n", str(ranks), *command]


def run(*command):
    return subprocess.run(command, env=ENVIRONMENT, capture_output=True, text=True, timeout=PATIENCE)


def itr_run(ranks, folder, *more):
    return run(*mpirun(ranks, ITR, "run", SCENE, "-o", str(folder), *more))


def is_there(solver):
    return any(row.startswith(solver + " ") and "absent" not in row for row in run(ITR, "solvers").stdout.splitlines())


def energies(folder):
    return [json.loads(line)["energy"]["total"] for line in (folder / "steps.jsonl").read_text().splitlines()]


def descendants(pid):
    pids = []
    for task in pathlib.Path(f"/proc/{pid}/task").glob("*/children"):
        for child in task.read_text().split():
            pids += [int(child), *descendants(child)]
    return pids


def is_running(pid):
    try:
        return pathlib.Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] not in "ZX"
    except OSError:
        return False


def rank_of(pid):
    for entry in pathlib.Path(f"/proc/{pid}/environ").read_bytes().split(b"\0"):
        if entry.startswith(b"OMPI_COMM_WORLD_RANK="):
            return int(entry.split(b"=")[1])
    return None


def test_same_result_on_any_number_of_ranks(scratch):
    # Few: where ranks wait for a core that others keep busy, each message may take a slice of the scheduler's time.
    few_steps = ["--set", "/time/tend=1", "--set", "/time/dt=0.5", "--solver", "mumps"]
    results = []
    for ranks in (1, 2, 3):
        folder = scratch / f"ranks{ranks}"
        done = itr_run(ranks, folder, *few_steps)
        assert done.returncode == 0, done.stderr
        results.append(energies(folder))
    assert len(results[0]) == 3 and results[0][-1] > 1e-3, results[0]
    for other in results[1:]:
        for a, b in zip(results[0], other, strict=True):
            assert abs(a - b) <= 1e-9 * max(abs(a), results[0][-1]), (a, b)


def test_multigrid_has_the_same_result_on_any_number_of_ranks(scratch):
    if not is_there("belos:muelu"):
        return
    scene = str(pathlib.Path(SOURCE) / "examples" / "cantilever.json")
    one_step = ["--set", "/time/tend=0.05", "--set", "/time/dt=0.05", "--set", "/space/remesh/enabled=false"]
    results = []
    for ranks in (1, 2, 3):
        folder = scratch / f"ranks{ranks}"
        done = run(*mpirun(ranks, ITR, "run", scene, "-o", str(folder), "--solver", "belos:muelu", *one_step))
        assert done.returncode == 0, done.stderr
        results.append(energies(folder)[-1])
    assert results[0] < -1e3, results
    assert all(abs(other - results[0]) <= 1e-9 * abs(results[0]) for other in results), results


def test_one_message_for_a_solver_without_mpi(scratch):
    for solver in ("eigen", "auto"):
        done = itr_run(2, scratch / "wrong", "--solver", solver)
        assert done.returncode == 2, done.returncode
        assert done.stderr.count("which does not use MPI") == 1, done.stderr
        assert "does not use MPI" in done.stderr and "mumps" in done.stderr, done.stderr


def test_a_mistake_that_one_rank_alone_sees_is_told(scratch):
    # As a launcher that does not end the others starts it: the file is on no other machine.
    environment = dict(ENVIRONMENT, OMPI_COMM_WORLD_RANK="1", OMPI_COMM_WORLD_SIZE="2")
    done = subprocess.run([ITR, "run", str(scratch / "elsewhere.json")], env=environment, capture_output=True, text=True,
                          timeout=PATIENCE)
    assert done.returncode == 2 and "rank 1: " in done.stderr and "elsewhere.json" in done.stderr, done


def test_all_end_when_rank_0_fails(scratch):
    done = itr_run(2, scratch / "fails", "--solver", "mumps", "--set", "/solver/nonlinear/max_iterations=1",
                   "--set", "/time/dt=5")
    assert done.returncode == 3, (done.returncode, done.stderr)


def test_all_end_when_a_rank_is_killed(scratch):
    for victim in (0, 1):
        with subprocess.Popen(mpirun(3, ITR, "run", SCENE, "-o", str(scratch / "killed"), "--solver", "mumps"),
                              env=ENVIRONMENT, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
            deadline = time.monotonic() + PATIENCE
            while not (scratch / "killed" / "frames" / "000002.h5").exists():
                assert time.monotonic() < deadline and process.poll() is None
                time.sleep(0.05)
            ranks = {rank_of(pid): pid for pid in descendants(process.pid)}
            os.kill(ranks[victim], signal.SIGKILL)
            assert process.wait(timeout=PATIENCE) != 0
            for rank in (0, 1, 2):
                deadline = time.monotonic() + PATIENCE
                while is_running(ranks[rank]):
                    assert time.monotonic() < deadline, rank
                    time.sleep(0.05)
        shutil.rmtree(scratch / "killed")


def test_interrupted_runs_end_with_a_good_state(scratch):
    with subprocess.Popen(mpirun(2, ITR, "run", SCENE, "-o", str(scratch / "interrupted"), "--solver", "mumps"),
                          env=ENVIRONMENT, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
        deadline = time.monotonic() + PATIENCE
        while not (scratch / "interrupted" / "frames" / "000002.h5").exists():
            assert time.monotonic() < deadline and process.poll() is None
            time.sleep(0.05)
        process.send_signal(signal.SIGINT)
        process.wait(timeout=PATIENCE)
    done = run(ITR, "certify", str(scratch / "interrupted"))
    assert done.returncode == 0, done.stdout


def test_a_host_hands_in_its_own_communicators(_):
    done = run(*mpirun(4, MPI_HOST))
    assert done.returncode == 0, done.stdout + done.stderr


def main():
    if not shutil.which("mpirun"):
        print("skipped: no mpirun (install openmpi-bin)")
        return 77
    if not is_there("mumps"):
        print("skipped: the solver mumps is absent")
        return 77
    for name, test in [item for item in globals().items() if item[0].startswith("test_")]:
        with tempfile.TemporaryDirectory() as scratch:
            start = time.monotonic()
            test(pathlib.Path(scratch))
            print(f"{name}: ok, {time.monotonic() - start:.1f} s", flush=True)
    return 0


sys.exit(main())
