#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# Builds the portable wheel, and runs README's Python program with it in a root that has Python, NumPy and nothing else, as root:
#   bash verification/debian/wheel.sh ROOT
# debootstrap makes the folder ROOT where it is not there, of this machine's release. Both kernels are run: the one that the
# processor asks for, and plain x86-64. wheel.log beside this script says how it ended.
set -euo pipefail
root=${1:?usage: $0 ROOT}
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
source=$(git -C "$here" rev-parse --show-toplevel)
suite=$(. /etc/os-release && echo "$VERSION_CODENAME")

[ -e "$root/etc/debian_version" ] ||
  debootstrap --variant=minbase --include=python3,python3-numpy "$suite" "$root" http://deb.debian.org/debian
wheels=$(mktemp -d)
trap 'rm -rf "$wheels"' EXIT
/usr/bin/python3 -m pip wheel "$source" --no-deps --no-build-isolation --config-settings portable=yes -w "$wheels" -q
rm -rf "$root/srv/itr"
/usr/bin/python3 -m pip install -q --no-deps --target "$root/srv/itr/site" "$wheels"/*.whl
cp -r "$source/examples" "$root/srv/itr/examples"
sed -n '/^```python$/,/^```$/p' "$source/README.md" | sed '/^```/d' >"$root/srv/itr/program.py"

status=0
mountpoint -q "$root/proc" || mount -t proc proc "$root/proc"
trap 'rm -rf "$wheels"; umount "$root/proc"' EXIT
run() {  # KERNEL COMMAND...
  echo "$1:"
  chroot "$root" env -i PATH=/usr/bin:/bin PYTHONPATH=/srv/itr/site sh -c 'cd /srv/itr && exec "$@"' run "${@:2}" 2>&1 | tail -n 2
}
{
  echo "commit $(git -C "$source" rev-parse --short HEAD), $(date -u +%F), Debian $(cat "$root/etc/debian_version")"
  echo "$(basename "$wheels"/*.whl): $(($(stat -c %s "$wheels"/*.whl) / 1024)) KiB"
  run "the processor's kernel" python3 -c 'import itr; print(itr._itr.__name__); exec(open("program.py").read())' || status=$?
  rm -r "$root/srv/itr/site/itr/x86_64_v3"
  run "plain x86-64" python3 -c 'import itr; print(itr._itr.__name__); exec(open("program.py").read())' || status=$?
} | tee "$here/wheel.log"
exit "$status"
