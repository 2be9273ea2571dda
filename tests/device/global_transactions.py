#!/usr/bin/env python3
"""How often the kernels of a frame read and write global memory at one lane, as oclgrind counts it; no GPU is needed.

global_transactions.py TABLE.csv NAME=DPR ...

Every DPR is a build of the program, NAME what the table calls it. Each takes the gradient of a loss by the positions of a sphere of
80 triangles at 32x32 pixels, with noise of the pixel and of the triangles. What is counted are instructions of work-items: what
neighbours read together on a GPU counts as often as they are.
"""
import collections
import csv
import json
import math
import os
import pathlib
import re
import subprocess
import sys
import tempfile

SIZE = 32
NOISES = ["pixel", "triangle"]


def icosahedron():
    """Corners at length one, and faces wound counter-clockwise as seen from outside."""
    golden = (1 + math.sqrt(5)) / 2
    corners = [unit(p) for a in (1, -1) for b in (golden, -golden) for p in ((0, a, b), (a, b, 0), (b, 0, a))]
    edge = 1.01 * min(math.dist(corners[0], c) for c in corners[1:])
    faces = []
    for i, a in enumerate(corners):
        for j, b in enumerate(corners):
            for k, c in enumerate(corners):
                meet = math.dist(a, b) < edge and math.dist(b, c) < edge and math.dist(c, a) < edge
                if i < j and i < k and j != k and meet and determinant(a, b, c) > 0:
                    faces.append((i, j, k))
    return corners, faces


def unit(p):
    return [x / math.hypot(*p) for x in p]


def determinant(a, b, c):
    return sum(a[i] * (b[(i + 1) % 3] * c[(i + 2) % 3] - b[(i + 2) % 3] * c[(i + 1) % 3]) for i in range(3))


def sphere():
    """The icosahedron with every face cut in four."""
    corners, faces = icosahedron()
    between, cut = {}, []

    def middle(i, j):
        key = min(i, j), max(i, j)
        if key not in between:
            between[key] = len(corners)
            corners.append(unit([x + y for x, y in zip(corners[i], corners[j])]))
        return between[key]

    for i, j, k in faces:
        a, b, c = middle(i, j), middle(j, k), middle(k, i)
        cut += [(i, a, c), (j, b, a), (k, c, b), (a, b, c)]
    return {"positions": corners, "faces": cut}


def scene(x):
    """The sphere, `x` to the side."""
    view = [[1, 0, 0, x], [0, 1, 0, 0], [0, 0, 1, -3], [0, 0, 0, 1]]
    camera = {"view": view, "fov_y_degrees": 60, "znear": 1, "zfar": 10}
    return {"width": SIZE, "height": SIZE, "camera": camera, "meshes": [sphere()], "gradients": ["positions"]}


def counts(dpr, noise, folder):
    """By kernel loads, stores, bytes loaded and bytes stored, over the whole run."""
    scene_file, target = folder / "scene.json", folder / "target.exr"
    scene_file.write_text(json.dumps(scene(0.3)))
    subprocess.run([dpr, "render", "--scene", scene_file, "-o", target, "--quiet"], check=True)
    scene_file.write_text(json.dumps(scene(0)))
    report = subprocess.run(
        ["oclgrind", "--inst-counts", dpr, "gradient", "--scene", scene_file, "--target", target, "--noise", noise, "--quiet",
         "-o", folder / "gradient.json"],
        check=True, capture_output=True, text=True, env={**os.environ, "DPR_LANES": "1"}).stdout
    found = collections.defaultdict(lambda: [0] * 4)
    for launch in report.split("Instructions executed for kernel ")[1:]:
        kernel = found[re.match(r"'(\w+)'", launch)[1]]
        for place, word in enumerate(("load", "store")):
            for count, size in re.findall(rf"(\d+) - {word} global \((\d+) bytes\)", launch):
                kernel[place] += int(count)
                kernel[place + 2] += int(size)
    return found


def main():
    table, *programs = sys.argv[1:]
    with open(table, "w", newline="") as file, tempfile.TemporaryDirectory() as name:
        rows = csv.writer(file, lineterminator="\n")
        rows.writerow(["program", "noise", "kernel", "loads", "stores", "loaded_bytes", "stored_bytes"])
        for program in programs:
            label, dpr = program.split("=", 1)
            for noise in NOISES:
                found = counts(dpr, noise, pathlib.Path(name))
                for kernel, of in sorted(found.items()):
                    rows.writerow([label, noise, kernel, *of])
                sums = [sum(of) for of in zip(*found.values())]
                print("{}, noise of the {}: {} loads and {} stores of {} and {} bytes".format(label, noise, *sums))


if __name__ == "__main__":
    main()
