#!/usr/bin/env bash
# The operator and the Python package beside the PyTorch of each version given, from PyPI: makes an environment, builds
# and installs the wheel, runs the tests, and prints a line. Not one of ctest's: it downloads up to 3 GB a version.
#
#   tests/torch/versions.sh [VERSION...]      1.13.1, 2.4.1 and the current one, unless given
#
# PYTHON chooses an interpreter for which PyPI has these versions, WORK a folder for environments, builds and logs.
set -euo pipefail
root=$(realpath "$(dirname "${BASH_SOURCE[0]}")/../..")
work=$(realpath -m "${WORK:-$root/build/torch-versions}")
python=${PYTHON:-python3}
failures=0

# test_version VERSION: in the environment that it makes; "current" is whatever pip takes.
test_version() {
  local version=$1 environment=$work/env-$1
  [[ -x $environment/bin/python ]] || "$python" -m venv "$environment"
  local requirement=torch
  if [[ $version != current ]]; then requirement=torch==$version; fi
  "$environment/bin/pip" install --quiet --upgrade-strategy only-if-needed "$requirement" "numpy<2" setuptools
  "$environment/bin/pip" install --verbose --no-deps --force-reinstall --config-settings=build-dir="$work/build-$version" \
    --config-settings=cmake.define.CMAKE_COMPILE_WARNING_AS_ERROR=ON "$root/lib/torch"
  local package
  package=$(cd "$work" && "$environment/bin/python" -c 'import dpr, pathlib; print(pathlib.Path(dpr.__file__).parent)')
  "$environment/bin/python" "$root/tests/torch/render_python_test.py" "$package/libdpr_torch.so"
  local name
  for name in package textures outputs; do "$environment/bin/python" "$root/tests/torch/${name}_test.py"; done
}

mkdir -p "$work"
versions=("$@")
if ((${#versions[@]} == 0)); then versions=(1.13.1 2.4.1 current); fi
for version in "${versions[@]}"; do
  log=$work/$version.log
  # In a shell of its own: as a condition it would not end at the first error.
  status=0
  test_version "$version" >"$log" 2>&1 &
  wait $! || status=$?
  found=$("$work/env-$version/bin/python" -c 'import torch; print(torch.__version__)' 2>/dev/null || echo "none")
  if ((status == 0)); then
    echo "PyTorch $version ($found): $(grep -oE '^Ran [0-9]+ tests' "$log" | paste -sd,), $(tail -1 "$log")"
  else
    echo "PyTorch $version ($found): FAILED, see $log"
    failures=$((failures + 1))
  fi
done
exit $((failures > 0))
