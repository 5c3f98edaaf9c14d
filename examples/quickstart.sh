#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# From a fresh Debian 12 to a picture: installs packages, builds the command, runs the 2D masticator with in-timestep
# remeshing on the built-in solver, draws its mesh before, during and after, and writes a page that shows the run.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

bash tests/install_packages.sh --minimal
cmake --preset release
cmake --build --preset release --target itr -- -j "$(nproc)"

build/release/bin/itr run examples/masticator.json -o results/masticator --overwrite --solver eigen --report
/usr/bin/python3 examples/render.py results/masticator -o results/masticator/masticator.png
echo "The picture is $PWD/results/masticator/masticator.png"
echo "To turn, play and click on in a browser: $PWD/results/masticator/report.html"
