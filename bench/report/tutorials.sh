#!/usr/bin/env bash
# Draws the pictures of include/examples by running the tutorials in full. From the repository's root, after
# `cmake --build --preset release`; the tutorials in PyTorch need a python3 that has torch.
#
#   bench/report/tutorials.sh [TUTORIAL...]    all unless given, by the names of their files
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
pictures=$PWD/include/examples/pictures
mkdir -p "$pictures"

# draw NAME COLUMNS WIDTH HEIGHT PICTURE LABEL ...: pictures of that size in rows, a label above each.
draw() {
  local name=$1 columns=$2 width=$3 height=$4 plots=() labels=() n=0
  shift 4
  local total=$((columns * (width + 2))) rows=$(($# / 2 / columns))
  while (($#)); do
    local x=$((n % columns * (width + 2))) y=$(((rows - 1 - n / columns) * (height + 20)))
    plots+=("\"$1\" binary filetype=png origin=($x,$y) with rgbimage")
    labels+=("set label $((n + 1)) \"$2\" at $((x + 5)),$((y + height + 9))")
    n=$((n + 1))
    shift 2
  done
  gnuplot <<END
set terminal pngcairo size $total,$((rows * (height + 20))) font "sans,10"
set output "$pictures/$name.png"
unset key; unset tics; unset border; unset colorbox
set lmargin 0; set rmargin 0; set tmargin 0; set bmargin 0
set xrange [-0.5:$total-0.5]; set yrange [-0.5:$((rows * (height + 20)))-0.5]
$(printf '%s\n' "${labels[@]}")
plot $(IFS=,; echo "${plots[*]}")
END
}

(($#)) || set -- first pose track mesh texture shading training materials glass light
for name in "$@"; do
  program=build/release/bin/dpr_document_tutorial_$name
  options=()
  [[ -x $program ]] && options+=(--program "$program")
  [[ $name =~ ^(first|shading|training|materials|glass)$ ]] && options+=(--python "$(command -v python3)")
  python3 tests/documents/blocks.py run "include/examples/$name.md" --source . --build build/release \
    --work "$work/$name" --full "${options[@]}"
  cd "$work/$name"
  case $name in
    first) draw first 4 160 160 image.png "an image" derivative.png "its derivative by a turn" target.png "turned" \
      found.png "the pose found" ;;
    training) draw training 1 768 96 unseen.png "pictures it has not seen" predicted.png "the poses that it says" ;;
    pose) draw pose 4 144 144 pose/target.png "the photograph" pose/start.png "the start" \
      pose/end.png "the pose found" found.png "in the light found" ;;
    track)
      PYTHONPATH=$OLDPWD/build/release/python python3 - <<END
import dpr

strip = dpr.read_image("track/frames.png")  # 480 pixels a frame, 2 between them
for i in (0, 5, 10, 15):
    dpr.write_image(f"shown{i}.png", strip[::2, 482 * i:482 * i + 480:2, :3])
END
      draw track 4 240 240 shown0.png "the first frame" shown5.png "a third on" shown10.png "two thirds on" \
        shown15.png "the last frame" ;;
    mesh) draw mesh 1 782 96 fit/targets.png "eight of the views" fit/results.png "the mesh found, from the same sides" ;;
    texture) draw texture 4 160 160 truth.png "the picture" step0.png "step 0" step10.png "step 10" step60.png "step 60" ;;
    shading) draw shading 3 160 160 truth.png "the picture" start.png "the first guess" found.png "found" ;;
    glass) draw glass 3 160 160 truth.png "the picture" start.png "the first guess" found.png "found" ;;
    materials) draw materials 3 160 160 truth.png "the picture" start.png "the first guess" found.png "found" ;;
    light) draw light 2 160 160 spot.png "the spot" change.png "as its cone grows" ;;
  esac
  cd - >/dev/null
done
