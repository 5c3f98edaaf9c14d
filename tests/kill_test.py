# SPDX-License-Identifier: MIT
"""Kills runs at calls of the system that write, replace or remove files: what is left can be read, and --resume ends as a run
that was not killed. Skipped without strace.

usage: kill_test.py ITR EXAMPLES
"""

import pathlib
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import xml.etree.ElementTree as ElementTree

import h5py

CALLS = ("pwrite64", "renameat2", "unlink", "ftruncate", "write")
AT = (1, 2, 3, 5, 8, 14, 25, 40)  # which one of these calls
LONG, SHORT = 5, 3  # steps
SETS = ("/space/remesh/enabled=false", "/output/paraview/vtu=true", "/output/checkpoint_period=0",
        '/output/forces=[{"name":"ball","bodies":1}]')
SERIES = {"sim.xdmf": "./Domain/Grid/Grid", "sim.pvd": "./Collection/DataSet"}


def run(itr, scene, folder, steps, *mode, kill=None):
    """Exit status and what the run said; `kill`: a call and its number."""
    command = [itr, "run", scene, "-o", folder, "--threads", "1", *mode, "--set", f'/time={{"dt":2e-5,"time_steps":{steps}}}']
    for text in SETS:
        command += ["--set", text]
    if kill:
        inject = f"inject={kill[0]}:signal=KILL:when={kill[1]}"
        command = ["strace", "-f", "-o", "/dev/null", "-e", f"trace={kill[0]}", "-e", inject, *command]
    done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    return done.returncode, done.stdout


def linked_frames(folder):
    with h5py.File(folder / "sim.h5") as file:
        return {name: file["frames"][name]["fields/x"][()].tobytes() for name in file["frames"]}


def check_readable(folder):
    """All that is there: each link of sim.h5 leads to a frame, and series name files that are there."""
    linked = linked_frames(folder) if (folder / "sim.h5").exists() else {}
    for name, path in SERIES.items():
        if (folder / name).exists():
            tree = ElementTree.parse(folder / name)
            parts = len(tree.findall(path))
            assert 2 * parts >= len(linked) - 1, (name, parts, len(linked))
            text = (folder / name).read_text()
            for file in set(re.findall(r"(?:frames|vtu)/\d+\.\w+", text)):
                assert (folder / file).exists(), f"{name} names {file}"
    for frame in folder.glob("frames/*.h5"):
        h5py.File(frame).close()


def names(folder):
    return {str(path.relative_to(folder)) for path in folder.rglob("*")}


def check_kills(itr, scene, work):
    whole, short, killed = (work / name for name in ("whole", "short", "killed"))
    for folder, steps in ((whole, LONG), (short, SHORT)):
        status, said = run(itr, scene, folder, steps)
        assert status == 0, said
    expected = linked_frames(whole)
    count = 0
    for mode in ((), ("--overwrite",), ("--resume",)):
        for call in CALLS:
            for number in AT:
                shutil.rmtree(killed, ignore_errors=True)
                if mode:
                    shutil.copytree(short, killed)
                status, said = run(itr, scene, killed, LONG, *mode, kill=(call, number))
                if status == 0:
                    break  # there are not so many of these calls
                assert status in (-signal.SIGKILL, 128 + signal.SIGKILL), said
                count += 1
                what = f"{mode} killed at {call} {number}"
                try:
                    check_readable(killed)
                except Exception as error:
                    raise AssertionError(f"{what}: {error}") from error
                status, said = run(itr, scene, killed, LONG, "--resume")
                assert status == 0, f"{what}: {said}"
                assert linked_frames(killed) == expected, what
                assert names(killed) == names(whole), (what, names(killed) ^ names(whole))
                assert (killed / "forces.csv").read_text() == (whole / "forces.csv").read_text(), what
    return count


def main():
    itr, examples = sys.argv[1:]
    can_trace = shutil.which("strace") and subprocess.run(["strace", "-o", "/dev/null", "true"], stderr=subprocess.DEVNULL).returncode == 0
    if not can_trace:
        print("no strace, or none that may trace")
        sys.exit(77)
    with tempfile.TemporaryDirectory() as work:
        count = check_kills(itr, pathlib.Path(examples) / "ball_wall.json", pathlib.Path(work))
    assert count > 50, count
    print(f"{count} kills")


if __name__ == "__main__":
    main()
