#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# Runs README's first command in a fresh root of another Debian release, as root:
#   bash verification/debian/run.sh SUITE ROOT        SUITE: bookworm, trixie, ...
# debootstrap makes the folder ROOT where it is not there. The committed tree is cloned into it. SUITE.log beside this script
# gives versions, the commit, and how the command ended.
set -euo pipefail
suite=${1:?usage: $0 SUITE ROOT} root=${2:?usage: $0 SUITE ROOT}
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
source=$(git -C "$here" rev-parse --show-toplevel)

[ -e "$root/etc/debian_version" ] || debootstrap --variant=minbase "$suite" "$root" http://deb.debian.org/debian
mountpoint -q "$root/proc" || mount -t proc proc "$root/proc"
trap 'umount "$root/proc"' EXIT
rm -rf "$root/srv/itr"
git clone -q "$source" "$root/srv/itr"

inside() { chroot "$root" env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin "$@"; }
log=$root/srv/quickstart.log status=0 begin=$SECONDS
inside bash /srv/itr/examples/quickstart.sh >"$log" 2>&1 || status=$?
{
  echo "commit $(git -C "$root/srv/itr" rev-parse --short HEAD), $(date -u +%F), Debian $(cat "$root/etc/debian_version")"
  inside dpkg-query -W -f '${Package} ${Version}\n' g++ cmake libcgal-dev libeigen3-dev libfmt-dev libhdf5-dev libtbb-dev python3 || true
  echo "examples/quickstart.sh: exit status $status after $((SECONDS - begin)) s; its last lines:"
  tail -n 12 "$log"
} | tee "$here/$suite.log"
exit "$status"
