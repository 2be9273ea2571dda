"""Poses of pictures that another renderer made, under light that the scene file does not know.

    python -m venv venv && venv/bin/pip install mitsuba numpy
    venv/bin/python foreign.py pictures FOLDER --scenes tests/data/foreign/{bag,fish,spot}.json
    venv/bin/python foreign.py poses FOLDER --dpr build/release/bin/dpr -o foreign.json

`pictures` path-traces every mesh from its own colours in random poses with Mitsuba 3: interreflection, an
environment, a point light and an area light, all drawn anew for each picture, on matt and on glossy surfaces; what
is not the object is black. `poses` searches for every pose with `dpr pose --search`, as a user would.
"""
import argparse
import json
import pathlib
import statistics
import subprocess
import tempfile

import numpy as np

def uniform_rotation(random):
    x, y, z, w = (lambda q: q / np.linalg.norm(q))(random.normal(size=4))
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                     [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                     [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]])


# ---- Pictures ----

def environment(random):
    """A sky of a colour of its own, with a few wide bright spots."""
    rows, columns = 32, 64
    polar, around = np.meshgrid((np.arange(rows) + 0.5) * np.pi / rows, (np.arange(columns) + 0.5) * 2 * np.pi / columns,
                                indexing="ij")
    direction = np.stack([np.sin(polar) * np.cos(around), np.cos(polar), np.sin(polar) * np.sin(around)], -1)
    sky = np.ones((rows, columns, 3)) * random.uniform(0.1, 0.6, 3)
    for _ in range(random.integers(1, 4)):
        towards = uniform_rotation(random)[0]
        sky += np.exp(random.uniform(2, 12) * (direction @ towards - 1))[..., None] * random.uniform(0.3, 2, 3)
    return sky.astype(np.float32)


def surface(attribute, glossy):
    color = {"type": "mesh_attribute", "name": attribute}
    if glossy:
        return {"type": "twosided", "bsdf": {"type": "principled", "base_color": color, "roughness": 0.4,
                                             "specular": 0.5}}
    return {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": color}}


def make_mesh(mi, mesh, rotation, glossy):
    """The scene's mesh: smooth where its colours are those of vertices, of flat faces else."""
    smooth = "vertex_colors" in mesh
    attribute = "vertex_color" if smooth else "face_color"
    properties = mi.Properties()
    properties["bsdf"] = mi.load_dict(surface(attribute, glossy))
    result = mi.Mesh("mesh", len(mesh["positions"]), len(mesh["faces"]), props=properties, has_vertex_normals=smooth)
    parameters = mi.traverse(result)
    parameters["vertex_positions"] = mi.Float((np.array(mesh["positions"]) @ rotation.T).astype(np.float32).ravel())
    parameters["faces"] = mi.UInt32(np.array(mesh["faces"], np.uint32).ravel())
    parameters.update()
    if smooth:
        result.recompute_vertex_normals()
    result.add_attribute(attribute, 3, mi.Float(np.array(mesh[attribute + "s"], np.float32).ravel()))
    return result


def path_trace(mi, scene, rotation, random, samples, seed, pixel_format="rgb"):
    """The picture of the scene's first mesh, which the rotation turns, and of its other meshes as they are."""
    camera_to_world = np.linalg.inv(scene["camera"]["view"])

    def place(distance):
        """Somewhere on the camera's side."""
        towards = uniform_rotation(random)[0]
        return towards * np.sign(towards @ camera_to_world[:3, 3]) * distance

    description = {
        "type": "scene",
        "integrator": {"type": "path", "max_depth": 8, "hide_emitters": True},
        "environment": {"type": "envmap", "bitmap": mi.Bitmap(environment(random))},
        "point": {"type": "point", "position": place(random.uniform(4, 8)).tolist(),
                  "intensity": {"type": "rgb", "value": random.uniform(5, 40, 3).tolist()}},
        "lamp": {"type": "sphere", "center": place(random.uniform(3, 5)).tolist(), "radius": 0.5,
                 "emitter": {"type": "area", "radiance": {"type": "rgb", "value": random.uniform(5, 25, 3).tolist()}}},
        **{f"mesh{i}": make_mesh(mi, mesh, rotation if i == 0 else np.eye(3), glossy=seed % 2 == 1)
           for i, mesh in enumerate(scene["meshes"])}}
    camera_to_world[:3, [0, 2]] *= -1  # Mitsuba's cameras look along +z, and x points to the left
    description["sensor"] = {
        "type": "perspective", "fov": scene["camera"]["fov_y_degrees"], "fov_axis": "y",
        "to_world": mi.ScalarTransform4f(camera_to_world),
        "sampler": {"type": "independent", "sample_count": samples},
        "film": {"type": "hdrfilm", "width": scene["width"], "height": scene["height"], "pixel_format": pixel_format,
                 "rfilter": {"type": "box"}}}
    return mi.render(mi.load_dict(description), seed=seed)


def make_pictures(arguments):
    import mitsuba as mi
    mi.set_variant(arguments.variant)
    arguments.folder.mkdir(parents=True, exist_ok=True)
    for file in arguments.scenes:
        (arguments.folder / file.name).write_bytes(file.read_bytes())
        scene = json.loads(file.read_text())
        random = np.random.default_rng(list(file.stem.encode()))
        truth = []
        for view in range(arguments.count):
            rotation = uniform_rotation(random)
            image = path_trace(mi, scene, rotation, random, arguments.samples, view)
            mi.Bitmap(image).convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float16, False).write(
                str(arguments.folder / f"{file.stem}{view:02}.exr"))
            truth.append(rotation.tolist())
        (arguments.folder / f"{file.stem}.truth").write_text(json.dumps(truth))
        print(file.stem, flush=True)


# ---- Poses ----

def angle_degrees(a, b):
    return float(np.degrees(np.arccos(np.clip((np.trace(np.array(a).T @ np.array(b)) - 1) / 2, -1, 1))))


def picture_of(file):
    """The picture beside a file, of the same name."""
    return next(file.with_suffix(suffix) for suffix in (".png", ".jpg", ".exr") if file.with_suffix(suffix).exists())


def run_pose(arguments, scene, target, *options):
    """What `dpr pose` finds in a picture of a scene."""
    with tempfile.TemporaryDirectory() as folder:
        scene_file, output = pathlib.Path(folder) / "scene.json", pathlib.Path(folder) / "pose.json"
        scene_file.write_text(json.dumps(scene))
        command = [arguments.dpr, "pose", "--scene", scene_file, "--target", target, "--quiet", "-o", output,
                   *options, *arguments.options.split()]
        subprocess.run([str(word) for word in command], check=True, stdout=subprocess.DEVNULL)
        return json.loads(output.read_text())


def summary(rows):
    errors = [row["angle_error_degrees"] for row in rows]
    return {"count": len(rows), "median_degrees": statistics.median(errors), "largest_degrees": max(errors),
            "below_2_degrees": sum(error < 2 for error in errors), "explained": sum(row["explained"] for row in rows),
            "median_seconds": statistics.median(row["seconds"] for row in rows)}


def find_poses(arguments):
    rows = []
    for truth_file in sorted(arguments.folder.glob("*.truth")):
        stem, scene = truth_file.stem, json.loads(truth_file.with_suffix(".json").read_text())
        for view, truth in enumerate(json.loads(truth_file.read_text())[:arguments.count]):
            pose = run_pose(arguments, scene, arguments.folder / f"{stem}{view:02}.exr", "--search")
            rows.append({"mesh": stem, "view": view, "angle_error_degrees": angle_degrees(pose["rotation_matrix"], truth),
                         "explained": pose["explained"], "loss": pose["loss"], "seconds": pose["seconds"]})
        print(stem, summary([row for row in rows if row["mesh"] == stem]), flush=True)
    result = {"schema": 1, "options": arguments.options, "all": summary(rows),
              "meshes": {name: summary([row for row in rows if row["mesh"] == name])
                         for name in sorted({row["mesh"] for row in rows})}, "poses": rows}
    print("all", result["all"])
    arguments.output.write_text(json.dumps(result, indent=1) + "\n")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(required=True)
    pictures = commands.add_parser("pictures")
    pictures.set_defaults(run=make_pictures)
    pictures.add_argument("--scenes", type=pathlib.Path, nargs="+", required=True,
                          help="each with a mesh of its own inline, and a perspective camera")
    pictures.add_argument("--samples", type=int, default=256, help="a pixel")
    pictures.add_argument("--variant", default="llvm_ad_rgb", help="of Mitsuba; scalar_rgb needs no LLVM")
    poses = commands.add_parser("poses")
    poses.set_defaults(run=find_poses)
    poses.add_argument("--dpr", default="dpr")
    poses.add_argument("--options", default="", help="further ones of dpr pose, in one word")
    poses.add_argument("-o", "--output", type=pathlib.Path, required=True)
    for command in (pictures, poses):
        command.add_argument("folder", type=pathlib.Path)
        command.add_argument("--count", type=int, default=24, help="pictures of each mesh")
    arguments = parser.parse_args()
    arguments.run(arguments)


if __name__ == "__main__":
    main()
