#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# Sets up, builds and runs all tests but the ones labelled `long`, and the short form of the verification suite. Needs
# Debian 12 and nothing else.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
export DEBIAN_FRONTEND=noninteractive

bash tests/install_packages.sh

if command -v clang-format >/dev/null; then
  find include src backends tests examples -name '*.[ch]pp' -print0 | xargs -0 clang-format --dry-run -Werror
fi

cmake --preset release
cmake --build --preset release -- -j "${ITR_JOBS:-2}"
ctest --test-dir build/release --output-on-failure --no-tests=error -LE long
python3 verification/run.py --quick
