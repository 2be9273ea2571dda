#!/usr/bin/env bash
# Draws results/front_page.png: Spot's pose, found from a wrong one by descent on the gradients while the blur shrinks.
# From the repository's root, with dpr in the PATH.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# Spot with colours, so that every side looks different.
awk '$1 == "v" { print $0, 0.3 + 0.28 * sin(4 * $2 + 1), 0.3 + 0.28 * sin(4 * $3), 0.3 + 0.28 * sin(4 * $4 + 2); next }
     { print }' bench/data/spot_low.obj >"$work/spot.obj"

# A scene with Spot turned about y, then tilted about x, by some degrees.
scene() {
  awk -v turn="$1" -v tilt="$2" 'BEGIN {
    degree = atan2(0, -1) / 180; a = turn * degree; b = tilt * degree
    printf "{\"width\": 160, \"height\": 160, \"background\": [1, 1, 1],\n"
    printf " \"camera\": {\"view\": [[1,0,0,0],[0,0.94,-0.34,0],[0,0.34,0.94,-3.6],[0,0,0,1]], \"fov_y_degrees\": 38,"
    printf " \"znear\": 1, \"zfar\": 7},\n"
    printf " \"meshes\": [{\"file\": \"spot.obj\", \"transform\": [[%f,0,%f,0],[%f,%f,%f,0],[%f,%f,%f,0],[0,0,0,1]]}],\n",
      cos(a), sin(a), sin(b) * sin(a), cos(b), -sin(b) * cos(a), -cos(b) * sin(a), sin(b), cos(b) * cos(a)
    printf " \"lights\": {\"ambient\": [0.5,0.5,0.5], \"point\": [{\"position\": [2,4,5], \"diffuse\": [0.5,0.5,0.5], \"specular\": [0.05,0.05,0.05]}]},\n"
    printf " \"smoothing\": {\"preset\": \"joint_gaussian\", \"sigma\": 1e-2, \"gamma\": 2e-2}}\n"
  }'
}
scene 145 0 >"$work/truth.json"
scene 95 -35 >"$work/start.json"
dpr render --scene "$work/truth.json" --preset rigid -o "$work/target.exr"
dpr pose --scene "$work/start.json" --target "$work/target.exr" --method descent --iterations 240 --restarts 0 \
  -o "$work/pose.json" --report "$work/report" --quiet

gnuplot <<END
set terminal pngcairo size 1460,200 font "sans,13"
set output "bench/results/front_page.png"
unset key; unset tics; unset border; unset colorbox
set lmargin 0; set rmargin 0; set tmargin 0; set bmargin 0
set xrange [-2:1458]; set yrange [-4:196]
set label 1 "the wrong pose, blurred" at 4,182
set label 2 "descent on the gradients: the pose turns, the blur shrinks" at 600,182 center
set label 3 "the pose found" at 1136,182
set label 4 "the target" at 1300,182
plot "$work/report/iterations.png" binary filetype=png with rgbimage, \
     "$work/report/target.png" binary filetype=png origin=(1298,0) with rgbimage
END
