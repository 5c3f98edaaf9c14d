#!/usr/bin/python3
# SPDX-License-Identifier: MIT
"""Reference runs: what the program computed before its structure changed, as digests and as values.

python3 verification/references/run.py [--record] [--case PART-OF-NAME]... [--itr PATH] [--jobs N]

Compares each run of cases.py with references.json, and with --record stores it there. Digests are of the bits of frames, states
and reports without times. Where they differ and PLANNED of cases.py allows it for this run, its values decide: energies, counts,
the verdict of `itr certify` and the positions of ten vertices. The exit status is 1 if a run differs by more than is planned.
"""
import argparse
import concurrent.futures
import hashlib
import json
import pathlib
import shutil
import subprocess
import sys
import tempfile

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parent.parent
sys.path[:0] = [str(HERE.parent), str(HERE)]
import cases  # noqa: E402
import h5py  # noqa: E402
import numpy as np  # noqa: E402
from harness import stored  # noqa: E402

STORE = HERE / "references.json"
# Keys that a clock, the machine or the name of the run decides.
NOT_RESULTS = {"seconds", "processor_seconds", "peak_rss_mb", "trial_seconds", "wall_seconds", "versions", "threads", "scene",
               "itr", "commit", "folder", "host"}
NOT_BITS = {"checkpoint/totals", "checkpoint/factor_record", "digests"}
COUNTS = ("vertices", "elements", "newton_iterations", "splits", "curves", "straightens", "collapses", "swaps", "smooths")
VERTICES = 10


def without_clock(value):
    if isinstance(value, dict):
        return {key: without_clock(item) for key, item in value.items() if key not in NOT_RESULTS}
    return [without_clock(item) for item in value] if isinstance(value, list) else value


def digest_of(pieces):
    total = hashlib.sha256()
    for piece in pieces:
        total.update(piece)
    return total.hexdigest()[:16]


def datasets(path):
    """(name, dataset) of a file, in the order of their names."""
    found = []
    with h5py.File(path) as file:
        file.visititems(lambda name, item: found.append((name, item[()])) if isinstance(item, h5py.Dataset) else None)
    return sorted(found, key=lambda pair: pair[0])


def bytes_of(name, data):
    data = np.asarray(data)
    return f"{name} {data.shape} {data.dtype.kind}".encode() + data.tobytes()


def accepted(count):
    return count["accepted"] if isinstance(count, dict) else count


def outcome(folder):
    """What a run left: digests and values."""
    paths = sorted((folder / "frames").glob("*.h5")) + sorted(folder.glob("*.h5"))
    frames, states = [], []
    for path in paths:
        if path.name == "sim.h5":
            continue
        for name, data in datasets(path):
            is_state = name.startswith("checkpoint/")
            if name not in NOT_BITS:
                (states if is_state else frames).append(bytes_of(f"{path.name}/{name}", data))
    steps = [json.loads(line) for line in (folder / "steps.jsonl").read_text().splitlines()]
    report = [json.dumps(without_clock(step), sort_keys=True).encode() for step in steps]
    forces = folder / "forces.csv"
    last = max((folder / "frames").glob("*.h5"))
    with h5py.File(last) as file:
        x = file["fields/x"][()]
    chosen = np.unique(np.linspace(0, len(x) - 1, VERTICES).astype(int))
    totals = {name: sum(accepted(step[name]) for step in steps) if name not in ("vertices", "elements") else steps[-1][name]
              for name in COUNTS}
    return {"digests": {"frames": digest_of(frames), "states": digest_of(states), "reports": digest_of(report),
                        "forces": digest_of([forces.read_bytes()] if forces.exists() else [])},
            "energies": {name: value for name, value in steps[-1]["energy"].items()}, "counts": totals,
            "positions": {str(i): x[i].tolist() for i in chosen}}


def perform(case, itr, scratch):
    """Runs a case, once for each of its commands, and returns its outcome."""
    folder = pathlib.Path(scratch) / "out"
    for arguments in case.commands(pathlib.Path(scratch)):
        done = subprocess.run([str(itr), "run", *map(str, arguments), "-o", str(folder)], capture_output=True, text=True)
        if not (folder / "steps.jsonl").exists():
            raise RuntimeError(f"{case.name}: {' '.join(map(str, arguments))} left no steps.jsonl: {done.stderr.strip()}")
    certified = subprocess.run([str(itr), "certify", str(folder)], capture_output=True, text=True)
    return {**outcome(folder), "run": done.returncode, "certify": certified.returncode}


def differences(name, before, now):
    """What of a run differs by more than is planned for it, in words."""
    changed = [kind for kind, digest in before["digests"].items() if now["digests"].get(kind) != digest]
    found = [f"{key}: {before[key]} is {now[key]}" for key in ("run", "certify") if before[key] != now[key]]
    plan = cases.planned(name)
    unplanned = [kind for kind in changed if plan is None or kind not in plan.digests]
    found += [f"{kind} have other bits" for kind in unplanned]
    if not changed or plan is None:
        return found
    scale = max(abs(value) for value in before["energies"].values()) or 1.0
    for key, value in before["energies"].items():
        if abs(now["energies"].get(key, np.nan) - value) > plan.energy * scale or key not in now["energies"]:
            found.append(f"energy {key}: {value} is {now['energies'].get(key)}")
    for key, value in before["counts"].items():
        if abs(now["counts"][key] - value) > plan.counts * max(value, 1):
            found.append(f"{key}: {value} is {now['counts'][key]}")
    if plan.positions is not None:
        extent = np.ptp(np.array(list(before["positions"].values())), axis=0).max() or 1.0
        for i, place in before["positions"].items():
            if i not in now["positions"] or np.abs(np.subtract(now["positions"][i], place)).max() > plan.positions * extent:
                found.append(f"vertex {i}: {place} is {now['positions'].get(i)}")
    return found


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("--record", action="store_true")
    parser.add_argument("--case", action="append", default=[])
    parser.add_argument("--itr", type=pathlib.Path, default=ROOT / "build/release/bin/itr")
    parser.add_argument("--jobs", type=int, default=2)
    options = parser.parse_args()
    chosen = [case for case in cases.CASES if not options.case or any(part in case.name for part in options.case)]
    references = json.loads(STORE.read_text()) if STORE.exists() else {}
    scratch = pathlib.Path(tempfile.mkdtemp())

    def one(case):
        folder = scratch / case.name
        folder.mkdir()
        try:
            return case.name, perform(case, options.itr, folder)
        finally:
            shutil.rmtree(folder)

    failed = 0
    with concurrent.futures.ThreadPoolExecutor(options.jobs) as pool:
        for name, now in pool.map(one, chosen):
            if options.record:
                references[name] = {"commit": stored.commit(), **now}
                found = []
            elif name not in references:
                found = ["no reference"]
            else:
                found = differences(name, references[name], now)
            failed += bool(found)
            print(f"{name}: {'; '.join(found) or ('recorded' if options.record else 'same')}", flush=True)
    scratch.rmdir()
    if options.record:
        STORE.write_text(json.dumps(dict(sorted(references.items())), indent=1) + "\n")
    print(f"{len(chosen)} runs, {failed} differ")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
