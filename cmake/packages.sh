# Sourced by demo.sh and test.sh: installs what a build needs and the machine lacks, on Debian and the like.
# shellcheck shell=bash disable=SC2034 # the sets are named by install_packages's arguments

# The command and its demo.
dpr_packages_demo=(
  g++ cmake ninja-build
  pocl-opencl-icd ocl-icd-opencl-dev opencl-clhpp-headers
  libglm-dev libeigen3-dev libopenmesh-dev libopenimageio-dev libpng-dev nlohmann-json3-dev libcli11-dev
  gnuplot-nox libjs-three
)
# The tests, the reference manual, and Debian packages by cpack. Where a release has no clang-19, a test is skipped.
dpr_packages_tests=(
  doctest-dev clang clang-19 libclc-19 doxygen git pkg-config libzip-dev python3 file dpkg-dev
)
# dpr learn, and the tests of the Python package.
dpr_packages_learning=(libgloo-dev libtorch-dev libopenblas0-pthread python3-torch python3-setuptools)
# The tests under a simulator of the kernels.
dpr_packages_oclgrind=(oclgrind)

# Fuzzing the readers.
dpr_packages_fuzzing=(clang-14 libclang-rt-14-dev llvm-14)

# Prints those of the packages that are not installed.
missing_packages() {
  local package
  for package in "$@"; do
    dpkg-query -W -f '${db:Status-Abbrev}' "$package" 2>/dev/null | grep -q '^ii' || echo "$package"
  done
}

# True if this release of the system has a package.
is_packaged() { apt-cache show "$1" >/dev/null 2>&1; }

# as_root COMMAND...: fails where there is no way to be root.
as_root() {
  if (($(id -u) == 0)); then
    "$@"
  else
    command -v sudo >/dev/null && sudo "$@"
  fi
}

# install_packages SET...: demo, tests, learning, oclgrind, fuzzing. What a release does not have is named and left out.
install_packages() {
  local packages=() set
  for set in "$@"; do
    local -n members=dpr_packages_$set
    packages+=("${members[@]}")
  done
  if ! command -v apt-get >/dev/null || ! command -v dpkg-query >/dev/null; then
    # Elsewhere the packages have other names: their installation is left to the user.
    echo "Needed are, under the names this system gives them: ${packages[*]}" >&2
    local tool
    for tool in c++ cmake ninja; do
      if ! command -v "$tool" >/dev/null; then
        echo "$tool is missing." >&2
        exit 1
      fi
    done
    return
  fi

  local missing package available=() absent=()
  mapfile -t missing < <(missing_packages "${packages[@]}")
  if ((${#missing[@]} == 0)); then return; fi
  as_root apt-get update -q || echo "apt-get update failed: its lists of packages stay as they are." >&2
  for package in "${missing[@]}"; do
    if is_packaged "$package"; then available+=("$package"); else absent+=("$package"); fi
  done
  if ((${#absent[@]} > 0)); then echo "This release has no ${absent[*]}: what needs them is skipped."; fi
  if ((${#available[@]} == 0)); then return; fi
  if ! as_root true; then
    echo "Missing packages, and neither root nor sudo to install them: ${available[*]}" >&2
    exit 1
  fi
  echo "Installing ${available[*]}"
  as_root env DEBIAN_FRONTEND=noninteractive apt-get install -q -y --no-install-recommends "${available[@]}"
}
