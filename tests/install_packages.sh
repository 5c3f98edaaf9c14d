#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# Installs Debian packages: with --minimal those of the command with CHOLMOD and of the pictures, else all that other solver
# modules, tests and the verification suite need too. Asks apt for what is missing only, so a machine that has
# all of them needs neither root nor a network.
set -euo pipefail

# ccache is among the first: a compiler that is launched in another way compiles all anew.
packages=(
  g++ cmake ninja-build ccache
  libeigen3-dev libtbb-dev libhdf5-dev zlib1g-dev nlohmann-json3-dev libcli11-dev libfmt-dev libspdlog-dev
  libcgal-dev libgmp-dev libmpfr-dev libsuitesparse-dev libopenblas-dev
  python3 python3-h5py python3-matplotlib python3-numpy
)
optional=(
  libmumps-dev libmumps-ptscotch-dev libptscotch-dev libopenmpi-dev openmpi-bin
  libtrilinos-{amesos2,tpetra,shylu,teuchos,kokkos,kokkos-kernels,epetra,epetraext,triutils,zoltan,trilinosss}-dev
  libtrilinos-{belos,muelu,xpetra,ifpack2,thyra,rtop}-dev
  libgtest-dev librapidcheck-dev libbenchmark-dev
  gfortran doxygen pkg-config python3-dev pybind11-dev python3-pip patchelf
  chromium chromium-driver firefox-esr strace
  python3-vtk9 xvfb xauth libgl1-mesa-dri
  python3-pil python3-dolfinx python3-meshio gmsh python3-scipy python3-sympy
)
case "${1:-}" in
  "") packages+=("${optional[@]}") ;;
  --minimal) ;;
  *) echo "usage: $0 [--minimal]" >&2; exit 2 ;;
esac

missing=()
for package in "${packages[@]}"; do
  [ "$(dpkg-query -W -f='${db:Status-Status}' "$package" 2>/dev/null || true)" = installed ] || missing+=("$package")
done
[ ${#missing[@]} -eq 0 ] && exit 0

as_root=()
if [ "$(id -u)" -ne 0 ]; then
  if ! command -v sudo >/dev/null; then
    echo "missing packages, and neither root nor sudo to install them: ${missing[*]}" >&2
    exit 1
  fi
  as_root=(sudo)
fi
echo "installing: ${missing[*]}"
"${as_root[@]}" apt-get update -q
"${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -y -q --no-install-recommends "${missing[@]}"
