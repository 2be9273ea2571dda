#!/usr/bin/env bash
# Installs the Debian packages into a new Debian 12 with nothing beside what they depend on, and uses them there: the
# command and its self-test, programs in C and C++20, and Python. As root, with a network; some minutes and 3 GB.
#
#   tests/packages/clean_root.sh PACKAGES ROOT     a folder of .deb files (cpack --preset packages); a folder to make
set -euo pipefail
packages=$(realpath "$1")
root=$2
cd "$(dirname "${BASH_SOURCE[0]}")/.."

if [[ ! -e $root/etc/debian_version ]]; then
  debootstrap --variant=minbase bookworm "$root" http://deb.debian.org/debian
fi
mkdir -p "$root/packages" "$root/tests"
cp "$packages"/*.deb "$root/packages/"
cp -r consumer examples torch "$root/tests/"
# What drivers ask about the machine.
trap 'umount "$root/proc" "$root/sys"' EXIT
mount -t proc proc "$root/proc"
mount -t sysfs -o ro sysfs "$root/sys"

# inside COMMAND: a shell's command within the root.
inside() { chroot "$root" /usr/bin/env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/root LANG=C.UTF-8 bash -o pipefail -euc "$1"; }
# install PACKAGE...: ours by path, with what they depend on and nothing else.
install() { inside "DEBIAN_FRONTEND=noninteractive apt-get install -qq -y --no-install-recommends -o Dpkg::Use-Pty=0 $* >/dev/null"; }

inside 'apt-get update -qq'
echo "== the command"
install /packages/dpr_*.deb /packages/libdpr0*.deb /packages/libdpr-image*.deb pocl-opencl-icd
inside 'cd /tmp && dpr devices --check | tail -1 && dpr demo -o demo --quiet && ls demo/index.html'

echo "== C and C++20"
install /packages/libdpr-dev*.deb g++ cmake ninja-build pkg-config
# shellcheck disable=SC2016 # the inner shell's
inside 'cd /tmp && cc -std=c99 -Wall -Werror /tests/examples/from_c.c -o from_c $(pkg-config --cflags --libs dpr) && ./from_c'
inside 'cmake -S /tests/consumer -B /tmp/consumer -G Ninja >/dev/null && cmake --build /tmp/consumer >/dev/null &&
  /tmp/consumer/main /tmp/cube.png /tmp/cube.exr && /tmp/consumer/embedder'

echo "== Python"
install /packages/libdpr-torch*.deb /packages/python3-dpr*.deb
inside 'cd /tmp && python3 /tests/torch/package_test.py 2>&1 | tail -3'
