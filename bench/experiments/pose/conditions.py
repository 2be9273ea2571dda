"""`dpr pose` on 48 pictures of the kinds that people have, and from starts that are off, with depths, as trackers do.

    python -m venv venv && venv/bin/pip install mitsuba numpy pillow
    venv/bin/python conditions.py pictures FOLDER --scenes tests/data/foreign/{bag,fish,spot}.json
    venv/bin/python conditions.py search FOLDER --dpr build/release/bin/dpr -o conditions.json
    venv/bin/python conditions.py refine FOLDER --dpr build/release/bin/dpr -o refine.json

`pictures` path-traces a chair, a bracket, Spot and a mug by Mitsuba 3 in unknown light, each in twelve conditions, and those
four, the bag and the fish with masks and depths. `search` knows neither rotation nor place, but a box where others than
the object are in the picture. `refine` starts 1, 10 and 40 degrees off and a fiftieth of the distance, as Diff-DOPE's
examples do (Tremblay et al. 2023), with the picture, its mask and its depths.
"""
import argparse
import json
import pathlib
import resource
import statistics

import numpy as np

from foreign import path_trace, picture_of, run_pose, uniform_rotation
from uncertainty import add_clutter, affine, blurred, hide, mug, save, turn
from unmasked import errors_of, projected_box

BOX = ["--box", "--unknown-background"]
CONDITIONS = {  # and what a user adds to `--search --translation`
    "light": [], "gloss": [], "jpeg": [], "noise": [], "blur": [], "small": [], "place": [], "border": [],
    "occluded": ["--robust"], "clutter": BOX, "objects": BOX, "phone": BOX}


# ---- Objects ----

def block(middle, half, color):
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * half + middle
    sides = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    return corners, [triangle for a, b, c, d in sides for triangle in ([a, b, c], [a, c, d])], [color] * 12


def of_blocks(blocks):
    positions, faces, colors = [], [], []
    for corners, triangles, color in blocks:
        faces += (np.array(triangles) + len(positions)).tolist()
        positions += corners.tolist()
        colors += color
    return {"positions": positions, "faces": faces, "face_colors": colors}


def chair():
    wood, cloth = [0.45, 0.25, 0.12], [0.1, 0.25, 0.5]
    return of_blocks([block((0, 0, 0), (0.6, 0.07, 0.6), cloth), block((0, 0.75, -0.54), (0.45, 0.3, 0.04), cloth)]
                     + [block((x, -0.6, 0.52), (0.08, 0.55, 0.08), wood) for x in (-0.52, 0.52)]
                     + [block((x, 0, -0.52), (0.08, 1.15, 0.08), wood) for x in (-0.52, 0.52)])


def bracket():
    """Two plates at right angles, the wider with a lug, and a rib between them, of one colour."""
    grey = [0.5, 0.5, 0.52]
    return of_blocks([block((0, -0.9, 0), (1.0, 0.12, 0.7), grey), block((-0.88, 0.1, 0), (0.12, 0.9, 0.5), grey),
                      block((0.1, -0.9, 0.85), (0.3, 0.12, 0.2), grey), block((-0.4, -0.5, -0.3), (0.4, 0.3, 0.1), grey)])


def objects(files):
    meshes = {file.stem: json.loads(file.read_text())["meshes"][0] for file in files}
    return {"chair": chair(), "bracket": bracket(), "mug": mug(), **meshes}


def draw_rotation(random, stem, view):
    """Of a mug one that shows the hollow, and the handle, without which its turns about the axis look alike."""
    while True:
        rotation = uniform_rotation(random)
        handle, axis = (view[:3, :3] @ rotation)[2, :2]  # how far these point towards the camera
        if stem != "mug" or (axis > 0.2 and handle > -0.4):
            return rotation


def moved(mesh, rotation, place):
    return dict(mesh, positions=(np.array(mesh["positions"]) @ np.transpose(rotation) + place).tolist())


# ---- Pictures ----

def photograph(mi, scene, meshes, random, glossy, samples):
    """Linear colours and the coverage of the first mesh."""
    def trace(meshes, seed, random):
        return np.array(path_trace(mi, dict(scene, meshes=meshes), np.eye(3), random, samples, seed, "rgba"))
    seed = 2 * int(random.integers(1 << 20)) + glossy
    image = trace(meshes, seed, random)
    coverage = trace(meshes[:1], seed, np.random.default_rng(0))[..., 3:] if len(meshes) > 1 else image[..., 3:]
    return image[..., :3] * random.uniform(0.5, 0.9) / np.quantile(image[..., :3][coverage[..., 0] > 0.5], 0.98), coverage


def around(scene, rotation, place, random, others):
    """Other objects beside it, some nearer, some behind."""
    view = np.array(scene["camera"]["view"])
    placed = []
    for i, mesh in enumerate(others):
        angle = 2 * np.pi * (i + random.uniform(0, 0.6)) / len(others)
        beside = 2.1 * np.array([np.cos(angle), np.sin(angle), 0]) + [0, 0, random.uniform(-1, 0.5)]
        placed.append(moved(mesh, uniform_rotation(random), place + view[:3, :3].T @ beside))
    return placed


def make_condition(mi, scene, stem, condition, meshes, random, samples):
    """The scene as a user has it, the picture, its quality as JPEG (0: PNG), rotation, place and box of the truth."""
    mesh, view = dict(meshes[stem]), np.array(scene["camera"]["view"])
    scene = dict(scene, camera=dict(scene["camera"], view=view.tolist()))
    rotation, to_world = draw_rotation(random, stem, view), view[:3, :3].T
    place = random.uniform(-0.4, 0.4, 3)
    if condition == "small":
        view[2, 3] *= 2.2
        scene["camera"]["view"] = view.tolist()
    if condition == "border":
        place = to_world @ np.array([random.choice([-1, 1]) * 3.2, random.uniform(-0.5, 0.5), 0])
    if condition == "place":
        mesh = moved(mesh, np.eye(3), [4, 4, 4])
        place = to_world @ np.array([random.choice([-1, 1]) * 1.3, random.choice([-1, 1]) * 1.3, 0]) - rotation @ [4, 4, 4]
    shown = [moved(mesh, rotation, place)]
    if condition == "objects":
        shown += around(scene, rotation, place, random, [m for name, m in meshes.items() if name != stem][:3])
    image, coverage = photograph(mi, scene, shown, random, condition == "gloss", samples)
    if condition in ("clutter", "phone"):
        image = add_clutter(random, image, coverage)
    if condition in ("occluded", "phone"):
        hide(random, image, coverage, 0.1, 0.2)
    image = blurred(image, {"blur": 1.0, "phone": 0.6}.get(condition, 0))
    image = image + random.normal(size=image.shape) * {"noise": 0.08, "phone": 0.02}.get(condition, 0)
    box = projected_box(scene, np.array(shown[0]["positions"]))
    return dict(scene, meshes=[mesh]), image, {"jpeg": 40, "phone": 75}.get(condition, 0), rotation, place, box


def save_depths(mi, scene, mesh, path):
    """Along the camera's axis, 0 beside the object; and its mask."""
    view = np.array(scene["camera"]["view"])
    eye, towards = -view[:3, :3].T @ view[:3, 3], -view[2, :3]
    triangles = np.array(mesh["positions"])[np.array(mesh["faces"])]
    size, half = scene["width"], np.tan(np.radians(scene["camera"]["fov_y_degrees"]) / 2)
    x, y = np.meshgrid((np.arange(size) + 0.5) / size * 2 - 1, 1 - (np.arange(size) + 0.5) / size * 2)
    ray = (np.stack([x * half, y * half, -np.ones_like(x)], -1).reshape(-1, 3) @ view[:3, :3])
    depth = np.full(len(ray), np.inf)
    for a, b, c in triangles:  # Moeller and Trumbore's
        p = np.cross(ray, c - a)
        with np.errstate(divide="ignore", invalid="ignore"):
            inverse = 1 / (p @ (b - a))
            u, q = p @ (eye - a) * inverse, np.cross(eye - a, b - a)
            v, t = ray @ q * inverse, (c - a) @ q * inverse
        depth = np.where((u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0) & (t < depth), t, depth)
    depth = np.where(np.isfinite(depth), depth, 0).reshape(size, size) * float(towards @ towards)
    mi.Bitmap(depth.astype(np.float32)[..., None]).write(str(path.with_suffix(".depth.exr")))
    mi.Bitmap((255 * (depth > 0)).astype(np.uint8)[..., None]).write(str(path.with_suffix(".mask.png")))


def make_pictures(arguments):
    import mitsuba as mi
    mi.set_variant(arguments.variant)
    arguments.folder.mkdir(parents=True, exist_ok=True)
    base = dict(json.loads(arguments.scenes[0].read_text()), width=96, height=96)
    meshes = objects(arguments.scenes)
    for stem in ("chair", "bracket", "spot", "mug"):
        for condition, options in CONDITIONS.items():
            random = np.random.default_rng([arguments.seed, *f"{stem} {condition}".encode()])
            scene, image, quality, rotation, place, box = make_condition(mi, base, stem, condition, meshes, random, arguments.samples)
            name = f"{stem}-{condition}"
            save(arguments.folder / name, image, quality)
            (arguments.folder / f"{name}.json").write_text(json.dumps(scene))
            words = [word if word != "--box" else f"--box={','.join(f'{side:.1f}' for side in box)}" for word in options]
            (arguments.folder / f"{name}.search").write_text(json.dumps(
                {"rotation": rotation.tolist(), "translation": place.tolist(), "options": words, "condition": condition}))
        print(stem, flush=True)
    base.update(width=160, height=160)
    for stem, mesh in meshes.items():
        for number in range(arguments.count):
            random = np.random.default_rng([arguments.seed, number, *stem.encode()])
            rotation, place = draw_rotation(random, stem, np.array(base["camera"]["view"])), random.uniform(-0.4, 0.4, 3)
            shown, path = moved(mesh, rotation, place), arguments.folder / f"{stem}{number}"
            image, _ = photograph(mi, base, [shown], random, number % 2 == 1, arguments.samples)
            save(path, image, 0)
            save_depths(mi, base, shown, path)
            path.with_suffix(".json").write_text(json.dumps(dict(base, meshes=[mesh])))
            path.with_suffix(".refine").write_text(json.dumps({"rotation": rotation.tolist(), "translation": place.tolist()}))
        print(stem, "with depths", flush=True)


# ---- Poses ----

def find_pose(arguments, path, scene, case, options):
    """Errors of `dpr pose`, and the seconds its process and its children took of all processors."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    pose = run_pose(arguments, scene, picture_of(path), "--translation", *options)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    points = np.array(scene["meshes"][0]["positions"])
    return {"case": path.stem, **errors_of(pose, case, (points.min(0) + points.max(0)) / 2),
            "cpu_seconds": after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime}


def summarize(name, rows):
    right = [row["degrees"] < 5 for row in rows]
    print(f"{name}: {sum(right)} of {len(rows)} below 5 degrees, median {statistics.median(row['degrees'] for row in rows):.2f}; "
          f"explained though wrong {sum(row['explained'] and not r for row, r in zip(rows, right))}, "
          f"right but unexplained {sum(r and not row['explained'] for row, r in zip(rows, right))}; "
          f"{statistics.median(row['cpu_seconds'] for row in rows):.2f} CPU s in the middle", flush=True)


def search(arguments):
    rows = []
    for file in sorted(arguments.folder.glob(arguments.only + ".search")):
        case = json.loads(file.read_text())
        rows.append({"condition": case["condition"],
                     **find_pose(arguments, file, json.loads(file.with_suffix(".json").read_text()), case, ["--search", *case["options"]])})
        print(rows[-1], flush=True)
    for condition in CONDITIONS:
        if any(row["condition"] == condition for row in rows):
            summarize(condition, [row for row in rows if row["condition"] == condition])
    summarize("all", rows)
    arguments.output.write_text(json.dumps(rows, indent=1) + "\n")


def refine(arguments):
    rows = []
    for file in sorted(arguments.folder.glob(arguments.only + ".refine")):
        case, scene = json.loads(file.read_text()), json.loads(file.with_suffix(".json").read_text())
        points, view = np.array(scene["meshes"][0]["positions"]), np.array(scene["camera"]["view"])
        middle, distance = (points.min(0) + points.max(0)) / 2, -view[2, 3]
        random = np.random.default_rng(list(file.stem.encode()))
        for degrees in (1, 10, 40):
            axis, step = uniform_rotation(random)[0], uniform_rotation(random)[0] * distance / 50
            start = turn(np.radians(degrees) * axis) @ case["rotation"]
            place = np.array(case["rotation"]) @ middle + case["translation"] + step - start @ middle
            scene["meshes"][0]["transform"] = affine(start, place).tolist()
            rows.append({"start": degrees, **find_pose(arguments, file, scene, case, [
                "--silhouette", file.with_suffix(".mask.png"), "--depth", file.with_suffix(".depth.exr")])})
            print(rows[-1], flush=True)
    for degrees in (1, 10, 40):
        summarize(f"{degrees} degrees", [row for row in rows if row["start"] == degrees])
    arguments.output.write_text(json.dumps(rows, indent=1) + "\n")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(required=True)
    pictures = commands.add_parser("pictures")
    pictures.set_defaults(run=make_pictures)
    pictures.add_argument("--scenes", type=pathlib.Path, nargs="+", required=True, help="those of tests/data/foreign")
    pictures.add_argument("--samples", type=int, default=64, help="a pixel")
    pictures.add_argument("--seed", type=int, default=1)
    pictures.add_argument("--count", type=int, default=2, help="pictures with depths, of each object")
    pictures.add_argument("--variant", default="llvm_ad_rgb", help="of Mitsuba")
    for name, function in (("search", search), ("refine", refine)):
        poses = commands.add_parser(name)
        poses.set_defaults(run=function)
        poses.add_argument("--dpr", default="dpr")
        poses.add_argument("--options", default="", help="further ones of dpr pose, in one word")
        poses.add_argument("--only", default="*", help="cases whose names are like this")
        poses.add_argument("-o", "--output", type=pathlib.Path, required=True)
        commands.choices[name].add_argument("folder", type=pathlib.Path)
    pictures.add_argument("folder", type=pathlib.Path)
    arguments = parser.parse_args()
    arguments.run(arguments)


if __name__ == "__main__":
    main()
