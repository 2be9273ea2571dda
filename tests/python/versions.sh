#!/usr/bin/env bash
# The Python package beside each of these, from PyPI: makes an environment, runs the tests there, and prints a line. The
# package is that of a build tree, the same for all. Not one of ctest's: it downloads up to 3 GB a version.
#
#   tests/python/versions.sh [WHAT...]      none, jax, and versions of PyTorch: 1.13.1, 2.4.1 and current, unless given
#
# PYTHON chooses an interpreter for which PyPI has these, BUILD the build tree, WORK a folder for environments and logs.
set -euo pipefail
root=$(realpath "$(dirname "${BASH_SOURCE[0]}")/../..")
build=$(realpath "${BUILD:-$root/build/release}")
work=$(realpath -m "${WORK:-$root/build/python-versions}")
python=${PYTHON:-python3}
export PYTHONPATH=$build/python DPR_DEVICE=${DPR_DEVICE:-cpu}
failures=0

# requirements WHAT: what pip takes for it.
requirements() {
  case $1 in
    none) echo numpy ;;
    jax) echo "jax numpy" ;;
    current) echo "torch numpy setuptools" ;;
    *) echo "torch==$1 numpy<2 setuptools" ;;
  esac
}

# test_with WHAT: in the environment that it makes.
test_with() {
  local environment=$work/env-$1
  [[ -x $environment/bin/python ]] || "$python" -m venv "$environment"
  local -a wanted
  read -ra wanted <<<"$(requirements "$1")"
  "$environment/bin/pip" install --quiet --upgrade-strategy only-if-needed "${wanted[@]}"
  local name
  for name in numpy jax arguments cameras package textures outputs tangents own_shading nvdiffrast nvdiffrast_texture; do
    "$environment/bin/python" "$root/tests/python/${name}_test.py"
  done
}

mkdir -p "$work"
all=("$@")
if ((${#all[@]} == 0)); then all=(none jax 1.13.1 2.4.1 current); fi
for what in "${all[@]}"; do
  log=$work/$what.log
  # In a shell of its own: as a condition it would not end at the first error.
  status=0
  test_with "$what" >"$log" 2>&1 &
  wait $! || status=$?
  versions=$("$work/env-$what/bin/pip" list 2>/dev/null | grep -E '^(torch|jax|numpy) ' | tr -s ' ' | paste -sd,)
  if ((status == 0)); then
    echo "$what ($versions): $(grep -oE '^Ran [0-9]+ tests' "$log" | paste -sd,), $(tail -1 "$log")"
  else
    echo "$what ($versions): FAILED, see $log"
    failures=$((failures + 1))
  fi
done
exit $((failures > 0))
