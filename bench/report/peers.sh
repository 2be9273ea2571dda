#!/usr/bin/env bash
# Draws results/peers.png: a step of each program, forward and backward, by workload. From the repository's root.
set -euo pipefail
results=bench/results
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

python3 - "$work" <<'END'
import csv, json, pathlib, sys
results, work = pathlib.Path("bench/results"), pathlib.Path(sys.argv[1])
order = ["cube128", "sphere256", "sphere20k", "sphere80k", "million"]
# Noise of the pixel, a blur of four pixels at 256x256; of the triangles, half a pixel, as a scene without more words has it.
presets = {"pixel": "joint", "sharp": "barrier"}
ours = json.loads((results / "pocl-3.1-skylake-avx512-2-cores.json").read_text())["results"]
for preset, composition in presets.items():
    with open(work / preset, "w") as out:
        for row in ours:
            kind = (row["preset"], row["composition"], row["estimator"])
            if kind == (preset, composition, "exact") and row["workload"] in order:
                if row["views"] == 1 and row["status"] == "ok":
                    print(order.index(row["workload"]), row["forward_ms"]["median"] + row["backward_ms"]["median"], file=out)
rows = csv.DictReader(line for line in open(results / "peers.csv") if not line.startswith("#"))
for row in rows:
    with open(work / row["program"].split()[0], "a") as out:
        print(order.index(row["workload"]), float(row["forward_ms"]) + float(row["backward_ms"]), file=out)
END

gnuplot <<END
set terminal pngcairo size 900,420 font "sans,12"
set output "$results/peers.png"
set title "A step, forward and backward, on two cores (DEODR uses one)"
set ylabel "milliseconds"; set logscale y; set format y "%g"; set grid ytics; set key right bottom
set bmargin 5
set xrange [-0.3:4.3]
set xtics ("cube\n12 triangles\n128x128" 0, "sphere\n1,280\n256x256" 1, "sphere\n20,480\n256x256" 2, \
           "sphere\n81,920\n512x512" 3, "sphere\n1,310,720\n1024x1024" 4)
set style data linespoints
plot "$work/pixel" title "dpr, noise of the pixel" lw 2 pt 7, "$work/sharp" title "dpr, noise of the triangles, sharp" lw 2 pt 5, \
     "$work/DEODR" title "DEODR 0.2.3, sharp" lw 2 pt 9, "$work/Mitsuba" title "Mitsuba 3.9, 16 samples a pixel" lw 2 pt 11
END
