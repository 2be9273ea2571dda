#!/usr/bin/env bash
# Which lines of the readers the inputs reach, seeds and what fuzzing found: fails where it is less than 95 of 100.
# coverage.sh PROGRAMS FOUND SEEDS MODULES...: folders of the fuzz programs, of their findings and of their seeds; modules that
# they load.
set -euo pipefail
programs=$1 found=$2 seeds=$3
shift 3
readers='base/(input_file|json_node)|codecs/openimageio|image/image_file|learn/npz|mesh/(mesh_reader|ply_header|read_|scan_text)|'
readers+='scene/scene_json|solve/shape_(state|views)'

profiles=$(mktemp -d)
trap 'rm -rf "$profiles"' EXIT
objects=()
for folder in "$seeds"/*/; do
  target=$(basename "$folder")
  LLVM_PROFILE_FILE="$profiles/$target-%m.profraw" "$programs/fuzz_$target" -runs=0 "$folder" "$found/$target" 2>/dev/null
  objects+=("$programs/fuzz_$target")
done
objects+=("$@")
llvm-profdata-14 merge -sparse -o "$profiles/all.profdata" "$profiles"/*.profraw
report=("${objects[0]}" "${objects[@]/#/-object=}" -instr-profile "$profiles/all.profdata")

if [[ -n ${DPR_COVERAGE_LINES:-} ]]; then llvm-cov-14 show "${report[@]}" >"$DPR_COVERAGE_LINES"; fi
llvm-cov-14 report "${report[@]}" |
  awk -v readers="lib/($readers)" '
    $1 ~ readers { printf "%-28s %5d lines, %5.1f%% reached\n", $1, $8, 100 - 100 * $9 / $8; lines += $8; missed += $9 }
    END { printf "%-28s %5d lines, %5.1f%% reached\n", "all", lines, 100 - 100 * missed / lines; exit !(missed < 0.05 * lines) }'
