#!/usr/bin/env bash
# Draws results/textured_spot.png: Spot's control mesh with its texture, lit, at 512x512.
# From the repository's root, with dpr in the PATH.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

cat >"$work/spot.json" <<END
{"width": 512, "height": 512, "background": [1, 1, 1],
 "camera": {"view": [[1, 0, 0, 0], [0, 0.97, -0.24, 0.05], [0, 0.24, 0.97, -2.9], [0, 0, 0, 1]],
            "fov_y_degrees": 45, "znear": 1, "zfar": 5},
 "meshes": [{"file": "$PWD/bench/data/spot_control_mesh.obj",
             "transform": [[-0.8, 0, -0.6, 0], [0, 1, 0, 0], [0.6, 0, -0.8, 0], [0, 0, 0, 1]],
             "texture": {"file": "$PWD/bench/data/spot_texture.png", "filter": "trilinear"}}],
 "lights": {"ambient": [0.3, 0.3, 0.3],
            "point": [{"position": [-2, 4, 4], "diffuse": [0.6, 0.6, 0.6], "specular": [0.05, 0.05, 0.05]}]},
 "smoothing": {"noise": "pixel", "sigma": 1e-6, "supersampling": 4}}
END
dpr render --scene "$work/spot.json" -o bench/results/textured_spot.png
