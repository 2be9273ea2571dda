# Sourced by demo.sh and test.sh: installs what a build needs and the machine lacks, on Debian and the like.
# shellcheck shell=bash disable=SC2034 # the sets are named by install_packages's arguments

# The command and its demo.
dpr_packages_demo=(
  g++ cmake ninja-build
  pocl-opencl-icd ocl-icd-opencl-dev opencl-clhpp-headers
  libglm-dev libeigen3-dev libopenmesh-dev libopenimageio-dev libpng-dev nlohmann-json3-dev libcli11-dev
  gnuplot-nox
)
# The tests, and the reference manual.
dpr_packages_tests=(doctest-dev clang clang-19 libclc-19 doxygen git pkg-config libzip-dev python3)
# The operator of libtorch and dpr learn.
dpr_packages_learning=(libgloo-dev libtorch-dev libopenblas0-pthread python3-torch)
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

# install_packages SET...: demo, tests, learning, oclgrind, fuzzing.
install_packages() {
  local packages=() set
  for set in "$@"; do
    local -n members=dpr_packages_$set
    packages+=("${members[@]}")
  done
  if ! command -v apt-get >/dev/null || ! command -v dpkg-query >/dev/null; then
    # Elsewhere the packages have other names: their installation is left to the user.
    local tool
    for tool in c++ cmake ninja; do
      if ! command -v "$tool" >/dev/null; then
        echo "$tool is missing. Needed are, under the names this system gives them:" >&2
        echo "  ${packages[*]}" >&2
        exit 1
      fi
    done
    return
  fi

  local missing
  mapfile -t missing < <(missing_packages "${packages[@]}")
  if ((${#missing[@]} == 0)); then return; fi
  local sudo=()
  if (($(id -u) != 0)); then
    if ! command -v sudo >/dev/null; then
      echo "Missing packages, and neither root nor sudo to install them: ${missing[*]}" >&2
      exit 1
    fi
    sudo=(sudo)
  fi
  echo "Installing ${missing[*]}"
  "${sudo[@]}" apt-get update -q
  "${sudo[@]}" env DEBIAN_FRONTEND=noninteractive \
    apt-get install -q -y --no-install-recommends "${missing[@]}"
}
