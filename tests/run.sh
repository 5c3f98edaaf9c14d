#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# Sets up, builds and runs all tests but the ones labelled `long`, a scene with every invariant asserted, and the short form
# of the verification suite. Needs Debian 12 and nothing else.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
export DEBIAN_FRONTEND=noninteractive
begun=$SECONDS
took() { echo "== $1: $((SECONDS - begun)) s"; begun=$SECONDS; }

bash tests/install_packages.sh
took "packages"

if command -v clang-format >/dev/null; then
  find include src backends tests examples -name '*.[ch]pp' -print0 | xargs -0 clang-format --dry-run -Werror
fi

cmake --preset release
cmake --build --preset release -- -j "${ITR_JOBS:-2}"
took "build"
ctest --test-dir build/release --output-on-failure --no-tests=error -LE long -j "${ITR_JOBS:-2}"
took "tests"

# A ball that hits a wall, with remeshing and friction: each edit and each step is checked.
cmake --build --preset release --target itr_audited -- -j "${ITR_JOBS:-2}"
audited=build/release/runs/ball_wall
build/release/bin/itr_audited run examples/ball_wall.json -o "$audited" --overwrite --set /time/tend=0.0008 \
  --set '/initial_conditions/velocity/0/value=[67, -20]' --set '/geometry/0/transformation/translation=[0.0629, 0]' \
  --set /contact/friction_coefficient=0.3 --set /space/remesh/split/acceptance_tolerance=1
build/release/bin/itr_audited certify "$audited"
took "audited scene"

python3 verification/run.py --quick --jobs "${ITR_JOBS:-2}"
took "quick suite"
