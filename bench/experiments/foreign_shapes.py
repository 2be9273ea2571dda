"""Shapes from pictures that another renderer made.

    python -m venv venv && venv/bin/pip install mitsuba numpy
    build/release/bin/dpr_experiments shapes -o FOLDER      # leaves spot.truth.obj, torus.truth.obj, ...
    venv/bin/python bench/experiments/foreign_shapes.py pictures FOLDER/*.truth.obj -o VIEWS
    venv/bin/python bench/experiments/foreign_shapes.py shapes VIEWS --dpr build/release/bin/dpr -o shapes.json
    venv/bin/python bench/experiments/foreign_shapes.py wrong VIEWS --dpr build/release/bin/dpr -o wrong.json

`pictures` path-traces every mesh from 24 sides with Mitsuba 3, in its own colours under a sky and a lamp. `shapes` finds
them with `dpr fit`, as a user would, and compares the solids. `wrong` spoils one view, and tells how well that view and
the others are explained.
"""
import argparse
import copy
import json
import pathlib
import resource
import subprocess

import numpy as np

VIEWS, SIZE, FIELD_OF_VIEW, DISTANCE = 24, 128, 45, 3.2
CELLS, HALF_SIDE = 64, 1.1  # of the grid on which solids are compared


# ---- Pictures ----

def look_at_origin(number):
    """World to camera (OpenGL) of a place on a spiral around the sphere."""
    height = 0.95 * (1 - (2 * number + 1) / VIEWS)
    azimuth = number * np.pi * (3 - np.sqrt(5))
    backwards = np.array([np.sqrt(1 - height**2) * np.sin(azimuth), height, np.sqrt(1 - height**2) * np.cos(azimuth)])
    right = np.cross([0, 1, 0], backwards)
    right /= np.linalg.norm(right)
    view = np.eye(4)
    view[:3, :3] = right, np.cross(backwards, right), backwards
    view[2, 3] = -DISTANCE
    return view


def read_obj(file):
    """Positions, colours or none, and triangles."""
    vertices, faces = [], []
    for line in file.read_text().splitlines():
        kind, *words = line.split() or [""]
        if kind == "v":
            vertices.append([float(word) for word in words])
        elif kind == "f":
            faces.append([int(word.split("/")[0]) - 1 for word in words])
    vertices = np.array(vertices)
    return vertices[:, :3], vertices[:, 3:], np.array(faces)


def make_mesh(mi, file):
    positions, colors, faces = read_obj(file)
    properties = mi.Properties()
    properties["bsdf"] = mi.load_dict({"type": "twosided", "bsdf": {
        "type": "diffuse", "reflectance": {"type": "mesh_attribute", "name": "vertex_color"}}})
    mesh = mi.Mesh("mesh", len(positions), len(faces), props=properties, has_vertex_normals=True)
    parameters = mi.traverse(mesh)
    parameters["vertex_positions"] = mi.Float(positions.astype(np.float32).ravel())
    parameters["faces"] = mi.UInt32(faces.astype(np.uint32).ravel())
    parameters.update()
    mesh.recompute_vertex_normals()
    mesh.add_attribute("vertex_color", 3, mi.Float(colors.astype(np.float32).ravel()))
    return mesh


def description(mi, file):
    return {"type": "scene",
            "integrator": {"type": "path", "max_depth": 6, "hide_emitters": True},
            "sky": {"type": "constant", "radiance": {"type": "rgb", "value": 0.5}},
            "lamp": {"type": "sphere", "center": [2, 4, 3], "radius": 0.7,
                     "emitter": {"type": "area", "radiance": {"type": "rgb", "value": 8.0}}},
            "mesh": make_mesh(mi, file)}


def sensor(mi, view, samples):
    camera_to_world = np.linalg.inv(view)
    camera_to_world[:3, [0, 2]] *= -1  # Mitsuba's cameras look along +z, and x points to the left
    return mi.load_dict({"type": "perspective", "fov": FIELD_OF_VIEW, "to_world": mi.ScalarTransform4f(camera_to_world),
                         "sampler": {"type": "independent", "sample_count": samples},
                         "film": {"type": "hdrfilm", "width": SIZE, "height": SIZE, "pixel_format": "rgba",
                                  "rfilter": {"type": "box"}}})


def make_pictures(arguments):
    import mitsuba as mi
    mi.set_variant(arguments.variant)
    for file in arguments.meshes:
        folder = arguments.output / file.name.split(".")[0]
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "truth.obj").write_bytes(file.read_bytes())
        scene = mi.load_dict(description(mi, file))
        views = []
        for number in range(VIEWS):
            view = look_at_origin(number)
            image = mi.render(scene, sensor=sensor(mi, view, arguments.samples), seed=number)
            mi.Bitmap(image).write(str(folder / f"{number:02}.exr"))
            views.append({"image": f"{number:02}.exr",
                          "camera": {"view": view.tolist(), "fov_y_degrees": FIELD_OF_VIEW, "znear": 1, "zfar": 6}})
        (folder / "views.json").write_text(json.dumps({"width": SIZE, "height": SIZE, "views": views}))
        print(folder, flush=True)


# ---- Shapes ----

def solid(file):
    """Cells of the grid whose centres the surface encloses: winding numbers along rays in z."""
    positions, _, faces = read_obj(file)
    centres = (np.arange(CELLS) + 0.5) / CELLS * 2 * HALF_SIDE - HALF_SIDE + 1e-6  # not through vertices
    winding = np.zeros((CELLS + 1, CELLS, CELLS), np.int64)
    for a, b, c in positions[faces]:
        low, high = np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)
        xs, ys = (np.flatnonzero((centres >= low[i]) & (centres <= high[i])) for i in (0, 1))
        double_area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
        if double_area == 0 or len(xs) == 0 or len(ys) == 0:
            continue
        x, y = np.meshgrid(centres[xs], centres[ys], indexing="ij")
        v = ((x - a[0]) * (c[1] - a[1]) - (y - a[1]) * (c[0] - a[0])) / double_area
        w = ((b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0])) / double_area
        inside = (v >= 0) & (w >= 0) & (v + w <= 1)
        z = a[2] + v * (b[2] - a[2]) + w * (c[2] - a[2])
        first_above = np.searchsorted(centres, z[inside])
        ix, iy = (index[inside] for index in np.meshgrid(xs, ys, indexing="ij"))
        np.add.at(winding, (first_above, ix, iy), np.sign(double_area).astype(np.int64))
    return np.cumsum(winding, 0)[:-1] != 0


def find_shapes(arguments):
    rows = []
    for folder in sorted(file.parent for file in arguments.folder.glob("*/views.json")):
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        subprocess.run([str(arguments.dpr), "fit", "--views", str(folder / "views.json"), "-o", str(folder / "fit.obj"),
                        "--quiet", *arguments.options.split()], check=True)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        truth, found = (solid(folder / name) for name in ("truth.obj", "fit.obj"))
        rows.append({"shape": folder.name, "iou": float((truth & found).sum() / (truth | found).sum()),
                     "cpu_seconds": round(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, 1)})
        print(rows[-1], flush=True)
    arguments.output.write_text(json.dumps({"views": VIEWS, "cells": CELLS, "rows": rows}, indent=1) + "\n")


# ---- Wrong views ----

SPOILT = 5  # view


def turned(view, degrees):
    """The camera carried around the world's vertical axis."""
    cosine, sine = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    turn = np.array([[cosine, 0, sine, 0], [0, 1, 0, 0], [-sine, 0, cosine, 0], [0, 0, 0, 1]])
    return (np.array(view) @ turn).tolist()


def explained(arguments, views):
    """What `dpr fit` says of every view."""
    arguments.work.mkdir(parents=True, exist_ok=True)
    (arguments.work / "views.json").write_text(json.dumps(views))
    subprocess.run([str(arguments.dpr), "fit", "--views", "views.json", "-o", "fit.obj", "--report", "report",
                    "--quiet", *arguments.options.split()], check=True, cwd=arguments.work)
    return json.loads((arguments.work / "report/fit.json").read_text())["views"]


def spoil_views(arguments):
    rows = []
    folders = sorted(file.parent.resolve() for file in arguments.folder.glob("*/views.json"))
    for folder, other in zip(folders, folders[1:] + folders[:1]):
        right = json.loads((folder / "views.json").read_text())
        for view in right["views"]:
            view["image"] = str(folder / view["image"])
        cases = {name: copy.deepcopy(right) for name in ("none", "turned by 5", "turned by 20", "another object's")}
        for degrees in (5, 20):
            camera = cases[f"turned by {degrees}"]["views"][SPOILT]["camera"]
            camera["view"] = turned(camera["view"], degrees)
        cases["another object's"]["views"][SPOILT]["image"] = str(other / f"{SPOILT:02}.exr")
        for wrong, views in cases.items():
            found = explained(arguments, views)
            spoilt = found.pop(SPOILT)
            parts = [view["unexplained_part"] for view in found]
            rows.append({"shape": folder.name, "wrong": wrong, "iou": spoilt["iou"], "part": spoilt["unexplained_part"],
                         "explained": spoilt["explained"], "others_iou": min(view["iou"] for view in found),
                         "others_part": max(parts), "median_part": float(np.median(parts)),
                         "others_unexplained": sum(not view["explained"] for view in found)})
            print(rows[-1], flush=True)
    arguments.output.write_text(json.dumps({"views": VIEWS, "spoilt": SPOILT, "rows": rows}, indent=1) + "\n")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--variant", default="llvm_ad_rgb", help="of Mitsuba")
    commands = parser.add_subparsers(required=True)
    pictures = commands.add_parser("pictures")
    pictures.add_argument("meshes", type=pathlib.Path, nargs="+")
    pictures.add_argument("--samples", type=int, default=64, help="of a pixel")
    pictures.add_argument("-o", "--output", type=pathlib.Path, required=True)
    pictures.set_defaults(run=make_pictures)
    shapes = commands.add_parser("shapes")
    shapes.add_argument("folder", type=pathlib.Path)
    shapes.add_argument("--dpr", default="dpr")
    shapes.add_argument("--options", default="", help="more options of dpr fit")
    shapes.add_argument("-o", "--output", type=pathlib.Path, required=True)
    shapes.set_defaults(run=find_shapes)
    wrong = commands.add_parser("wrong")
    wrong.add_argument("folder", type=pathlib.Path)
    wrong.add_argument("--dpr", default="dpr", type=lambda name: pathlib.Path(name).resolve() if "/" in name else name)
    wrong.add_argument("--options", default="", help="more options of dpr fit")
    wrong.add_argument("--work", type=pathlib.Path, default=pathlib.Path("wrong_views"), help="folder for the fits")
    wrong.add_argument("-o", "--output", type=pathlib.Path, required=True)
    wrong.set_defaults(run=spoil_views)
    arguments = parser.parse_args()
    arguments.run(arguments)


if __name__ == "__main__":
    main()
