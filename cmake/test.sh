#!/usr/bin/env bash
# Installs what is missing, then builds and tests each preset named as an argument; without any, the release.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
source cmake/packages.sh

presets=("$@")
if ((${#presets[@]} == 0)); then presets=(release); fi

sets=(demo tests)
for preset in "${presets[@]}"; do
  case $preset in
    release | ci) sets+=(learning) ;;
    oclgrind*) sets+=(oclgrind) ;;
    fuzz) sets+=(fuzzing) ;;
  esac
done
install_packages "${sets[@]}"

# Packages of some presets that not every release has.
declare -A needed=([oclgrind]=oclgrind [fuzz]=clang++-14)

summary=()
status=0
for preset in "${presets[@]}"; do
  echo "== $preset"
  tool=${needed[${preset%-stages}]:-}
  if [[ $tool ]] && ! command -v "$tool" >/dev/null; then
    summary+=("$(printf '%-15s skipped: there is no %s' "$preset" "$tool")")
    continue
  fi
  start=$SECONDS
  if cmake --preset "$preset" && cmake --build --preset "$preset" &&
    ctest --preset "$preset" -j"$(nproc)" --output-on-failure; then
    result=passed
  else
    result=FAILED
    status=1
  fi
  summary+=("$(printf '%-15s %s in %d s' "$preset" "$result" $((SECONDS - start)))")
done

echo "== summary"
printf '%s\n' "${summary[@]}"
exit "$status"
