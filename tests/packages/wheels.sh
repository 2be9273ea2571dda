#!/usr/bin/env bash
# Installs wheels by pip into a new environment beside what they depend on, and runs the README's example for Python there.
# Needs python3-venv alone, and a network for NumPy.
#
#   tests/packages/wheels.sh WHEELS [SUITE ROOT]    a folder of .whl files (cmake/wheel.sh); in a Debian of that name, which
#                                                   is made in the folder ROOT, as root
set -euo pipefail
wheels=$(realpath "$1")
cd "$(dirname "${BASH_SOURCE[0]}")/../.."

if (($# > 1)); then
  suite=$2 root=$3
  if [[ ! -e $root/usr/bin/python3 ]]; then
    debootstrap --variant=minbase --include=python3-venv "$suite" "$root" http://deb.debian.org/debian
  fi
  mkdir -p "$root/dpr/tests/packages" "$root/dpr/wheels"
  cp README.md "$root/dpr/"
  cp tests/packages/wheels.sh "$root/dpr/tests/packages/"
  cp "$wheels"/*.whl "$root/dpr/wheels/"
  # Drivers ask these about the machine.
  trap 'umount "$root/proc" "$root/sys"' EXIT
  mount -t proc proc "$root/proc"
  mount -t sysfs -o ro sysfs "$root/sys"
  chroot "$root" env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/root LANG=C.UTF-8 /dpr/tests/packages/wheels.sh /dpr/wheels
  exit
fi

folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
export XDG_CACHE_HOME=$folder/cache # no kernel has been compiled before
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check "$wheels"/dpr*_"$(uname -m)".whl
(cd "$wheels" && du -h --apparent-size dpr*_"$(uname -m)".whl)
"$folder/venv/bin/python" - README.md <<'END'
import re
import sys
import time

example = re.search(r"## Python\n+```python\n(.*?)```", open(sys.argv[1]).read(), re.S)[1]


def measured(what, run):
    start, used = time.perf_counter(), time.process_time()
    result = run()
    print(f"{what:20} {time.perf_counter() - start:7.3f} s, {time.process_time() - used:7.3f} s of processors")
    return result


names = {}
dpr = measured("import dpr", lambda: __import__("dpr"))
for device in dpr.devices():
    print(device["name"], device["version"], sep=", ")
measured("README's example", lambda: exec(example, names))
measured("the same again", lambda: exec(example, names))
assert names["image"].shape == (1, 64, 64, 4) and 0.1 < names["image"].mean() < 0.9
assert 0 < abs(names["gradient"]).max() < 1
END
