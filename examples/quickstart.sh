#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# From a fresh Debian to a picture: installs packages, builds the command and the fastest direct solver, runs the 2D masticator
# with in-timestep remeshing, draws its mesh before, during and after, and writes a page that shows the run.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

begun=$SECONDS
took() { echo "== $1: $((SECONDS - begun)) s"; begun=$SECONDS; }

bash tests/install_packages.sh --minimal
took "packages"
cmake --preset release
cmake --build --preset release --target itr itr_modules -- -j "$(nproc)"
took "build"

build/release/bin/itr run examples/masticator.json -o results/masticator --overwrite --report
took "run"
/usr/bin/python3 examples/render.py results/masticator -o results/masticator/masticator.png
echo "The picture is $PWD/results/masticator/masticator.png"
echo "To turn, play and click on in a browser: $PWD/results/masticator/report.html"
