#!/usr/bin/env bash
# Cross-builds the command for arm64 in a new Debian 13 and runs its self-test and demo there under qemu's emulation. As
# root, with a network, debootstrap and qemu-user-static; 4 GB, and as long as PoCL's compiler takes under emulation.
#
#   tests/packages/arm64.sh ROOT     a folder to make
set -euo pipefail
root=$1
cd "$(dirname "${BASH_SOURCE[0]}")/../.."

if [[ ! -e /proc/sys/fs/binfmt_misc/qemu-aarch64 ]]; then
  echo "This machine runs no programs for arm64: qemu-user-static is missing, or its entry in binfmt_misc" >&2
  exit 1
fi
if [[ ! -e $root/etc/debian_version ]]; then
  debootstrap --variant=minbase trixie "$root" http://deb.debian.org/debian
fi
mkdir -p "$root/dpr"
git ls-files -co --exclude-standard -z -- CMakeLists.txt CMakePresets.json cmake include kernels lib |
  tar --null -T - -c | tar -x -C "$root/dpr"
# Drivers ask these about the machine.
trap 'umount "$root/proc" "$root/sys"' EXIT
mount -t proc proc "$root/proc"
mount -t sysfs -o ro sysfs "$root/sys"

# inside COMMAND: a shell's command within the root. Under qemu 7.2 the process that tries a driver may hang.
inside() { chroot "$root" /usr/bin/env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/root LANG=C.UTF-8 DPR_TRIAL=off \
  bash -o pipefail -euc "$1"; }
install() { inside "DEBIAN_FRONTEND=noninteractive apt-get install -qq -y --no-install-recommends -o Dpkg::Use-Pty=0 $* >/dev/null"; }

inside 'dpkg --add-architecture arm64 && apt-get update -qq'
# PoCL needs a compiler of its own architecture, which takes the place of the cross compiler: it comes after the build.
if [[ ! -e $root/dpr/build/demo/bin/dpr ]]; then
  install g++-aarch64-linux-gnu cmake ninja-build opencl-clhpp-headers libglm-dev libeigen3-dev nlohmann-json3-dev \
    libcli11-dev gnuplot-nox libjs-three ocl-icd-opencl-dev:arm64 libopenmesh-dev:arm64 libopenimageio-dev:arm64 libpng-dev:arm64
  inside 'cd /dpr && cmake --preset demo -DCMAKE_SYSTEM_NAME=Linux -DCMAKE_SYSTEM_PROCESSOR=aarch64 \
    -DCMAKE_C_COMPILER=aarch64-linux-gnu-gcc -DCMAKE_CXX_COMPILER=aarch64-linux-gnu-g++ && ninja -C build/demo dpr_cli'
fi
install pocl-opencl-icd:arm64
inside 'cd /tmp && time /dpr/build/demo/bin/dpr devices --check'
inside 'cd /tmp && time /dpr/build/demo/bin/dpr demo -o demo'
