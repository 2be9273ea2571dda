#!/usr/bin/env bash
# Measures a step of dpr and of other renderers, and draws it. From the repository's root, after a build.
#
#   bench/report/peers.sh            installs DEODR and Mitsuba into build/peers, writes results/peers.csv, and draws
#   bench/report/peers.sh --draw     draws results/peers.png from results/peers.csv, and writes README's column
set -euo pipefail
results=bench/results
if [[ ${1:-} != --draw ]]; then
  export PATH=$PWD/build/release/bin:$PATH PYTHONPATH=$PWD/build/release/python DPR_DEVICE=cpu
  if [[ ! -e build/peers/complete ]]; then
    /usr/bin/python3 -m venv build/peers
    build/peers/bin/pip install --quiet deodr trimesh typing_extensions mitsuba
    touch build/peers/complete
  fi
  /usr/bin/python3 bench/report/peers.py --python build/peers/bin/python -o "$results/peers.csv"
fi
python3 bench/report/peers.py --write "$results/peers.csv" README.md

gnuplot <<END
set terminal pngcairo size 900,420 font "sans,12"
set output "$results/peers.png"
set title "A step that moves: image, loss and gradients, on two cores (DEODR uses one)"
set ylabel "milliseconds"; set logscale y; set format y "%g"; set grid ytics; set key right bottom
set bmargin 5
set xrange [-0.3:4.3]
set xtics ("cube\n12 triangles\n128x128" 0, "sphere\n1,280\n256x256" 1, "sphere\n20,480\n256x256" 2, \
           "sphere\n81,920\n512x512" 3, "sphere\n1,310,720\n1024x1024" 4)
set style data linespoints
set datafile separator ","
order = "cube128 sphere256 sphere20k sphere80k million"
place(name) = words(substr(order, 1, strstrt(order, name) - 1))
array programs[5] = ["dpr C++", "dpr NumPy", "dpr PyTorch", "DEODR", "Mitsuba"]
plot for [i = 1:5] "< grep '^" . programs[i] . ",' $results/peers.csv" using (place(strcol(3))):6 title programs[i] lw 2 pt 4 + i
END
