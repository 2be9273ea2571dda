#!/usr/bin/env bash
# Tries dpr in a new Debian with nothing beside what it asks for. As root, with a network; some 3 GB.
#
#   tests/packages/clean_root.sh SUITE [STEP...]              this checkout in bookworm, trixie or forky
#       demo   ./cmake/demo.sh            check    dpr devices --check, after demo
#       unit   the tests labelled unit    kernels  every kernel with every set of options
#       test   ./cmake/test.sh
#       Without STEP: demo check kernels unit. The last line is a row of the table in bench/results/notes.md.
#   tests/packages/clean_root.sh SUITE --packages FOLDER      the .deb files that cpack --preset packages wrote
#
# The root is kept, with ccache's files, in ${DPR_ROOTS:-~/.cache/dpr/roots}/SUITE;
# that of the packages is SUITE-packages.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
suite=$1
shift
root=${DPR_ROOTS:-${XDG_CACHE_HOME:-$HOME/.cache}/dpr/roots}/$suite
if [[ ${1:-} == --packages ]]; then root+=-packages; fi

# Ends the script where a root cannot be had, which says nothing of dpr.
skip() {
  echo "no root to test in: $1"
  exit 0
}

# inside COMMAND: a shell's command within the root, in this checkout with a build folder of the root's own. The mounts end
# with it. PoCL asks /proc and /sys about the machine.
inside() {
  # shellcheck disable=SC2016 # the inner shell's
  unshare --mount bash -euc '
    mount -t proc proc "$0/proc"
    mount -t sysfs -o ro sysfs "$0/sys"
    mkdir -p "$0/dpr" "$0/results"/{build,demo-output} build demo-output
    mount --bind . "$0/dpr"
    for folder in build demo-output; do mount --bind "$0/results/$folder" "$0/dpr/$folder"; done
    cp /etc/resolv.conf "$0/etc/resolv.conf"
    exec chroot "$0" /usr/bin/env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/root LANG=C.UTF-8 \
      bash -o pipefail -euc "cd /dpr; $1"' "$root" "$1"
}
# A version within the root.
version_of() { inside "dpkg-query -W -f '\${Version}' \$(dpkg-query -W -f '\${Package}\n' '$1' | head -1)" | sed 's/^.*://; s/[+-].*//'; }

(($(id -u) == 0)) || skip "not root, so no root of Debian"
unshare --mount true || skip "nothing can be mounted"
command -v debootstrap >/dev/null || [[ -e $root/complete ]] || skip "no debootstrap"
if [[ ! -e $root/complete ]]; then
  script=/usr/share/debootstrap/scripts/$suite
  [[ -e $script ]] || script=${script%/*}/sid
  rm -rf "${root:?}"
  mkdir -p "$root"
  debootstrap --variant=minbase --include=ca-certificates "$suite" "$root" http://deb.debian.org/debian "$script" \
    >"$root.log" 2>&1 || skip "debootstrap $suite failed, see $root.log"
  # A mirror may be behind.
  echo 'Acquire::Check-Valid-Until "false";' >"$root/etc/apt/apt.conf.d/99dpr"
  inside 'apt-get update -qq && apt-get install -qq -y --no-install-recommends ccache' >>"$root.log" 2>&1 ||
    skip "no packages for $suite, see $root.log"
  touch "$root/complete"
fi

if [[ ${1:-} == --packages ]]; then
  mkdir -p "$root/packages"
  cp "$2"/*.deb "$root/packages/"
  # install PACKAGE...: ours by path, with what they depend on and nothing else.
  install() { inside "DEBIAN_FRONTEND=noninteractive apt-get install -qq -y --no-install-recommends -o Dpkg::Use-Pty=0 $* >/dev/null"; }
  inside 'apt-get update -qq'
  echo "== the command"
  install /packages/dpr_*.deb /packages/libdpr0*.deb /packages/libdpr-image*.deb pocl-opencl-icd
  inside 'cd /tmp && dpr devices --check | tail -1 && dpr demo -o demo --quiet && ls demo/index.html'

  echo "== C and C++20"
  install /packages/libdpr-dev*.deb g++ cmake ninja-build pkg-config
  # shellcheck disable=SC2016 # the inner shell's
  inside 'cc -std=c99 -Wall -Werror include/examples/from_c.c -o /tmp/from_c $(pkg-config --cflags --libs dpr) && /tmp/from_c'
  inside 'cmake -S tests/consumer -B /tmp/consumer -G Ninja >/dev/null && cmake --build /tmp/consumer >/dev/null &&
    /tmp/consumer/main /tmp/cube.png /tmp/cube.exr && /tmp/consumer/embedder'

  echo "== Python"
  install /packages/python3-dpr*.deb
  inside 'cd /tmp && python3 /dpr/tests/python/numpy_test.py 2>&1 | tail -3'
  install python3-torch
  inside 'cd /tmp && python3 /dpr/tests/python/package_test.py 2>&1 | tail -3'
  exit
fi

# The part of a step's output that is a result.
declare -A fact=([demo]='to [0-9.]* degrees' [check]='[0-9]* comparisons' [kernels]='[0-9]* compilations.*'
  [unit]='[0-9]* tests failed out of [0-9]*' [test]='[0-9]* tests failed out of [0-9]*')

steps=("$@")
if ((${#steps[@]} == 0)); then steps=(demo check kernels unit); fi
declare -A results=()
status=0
for step in "${steps[@]}"; do
  case $step in
    # Built anew: objects of another checkout may look newer than the sources of this one.
    demo) command='rm -rf build/demo; ./cmake/demo.sh' ;;
    check) command='build/demo/bin/dpr devices --check' ;;
    kernels)
      command='source cmake/packages.sh; install_packages demo tests
        python3 tests/device/compile_kernels.py driver kernels'
      ;;
    unit)
      command='source cmake/packages.sh; install_packages demo tests; rm -rf build/release
        cmake --preset release -DDPR_BUILD_{BENCH,LEARN,TORCH}=OFF && cmake --build --preset release
        ctest --preset release -L unit'
      ;;
    test) command='rm -rf build/release; ./cmake/test.sh' ;;
    *)
      echo "no step $step" >&2
      exit 1
      ;;
  esac
  echo "== $suite: $step"
  start=$SECONDS
  result=passed
  if ! inside "$command" 2>&1 | tee "$root.$step.log"; then
    result=FAILED
    status=1
  fi
  results[$step]="$result: $(grep -o "${fact[$step]}" "$root.$step.log" | tail -1)"
  echo "== $suite: $step in $((SECONDS - start)) s, ${results[$step]}"
done

row="| $suite | $(version_of 'g++-[1-9]*') | $(version_of libpocl2-common) | $(version_of 'libopenimageio[2-9]*') |"
for step in "${steps[@]}"; do row+=" ${results[$step]} |"; done
echo "$row"
exit "$status"
