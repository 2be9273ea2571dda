"""Poses of objects before backgrounds that are not in the scene, by `dpr pose --unknown-background`.

    venv/bin/python unmasked.py FOLDER --dpr build/release/bin/dpr -o unmasked.json

FOLDER has cases of `uncertainty.py`, whose venv this needs: photographs, or `pictures --kinds clutter`. A box about the
object is given instead of a mask. Starts are some degrees and a tenth of the distance off.
"""
import argparse
import json
import pathlib

import numpy as np

from foreign import angle_degrees, picture_of, run_pose
from uncertainty import affine, turn


def mask_box(file):
    """Of the pixels that the mask shows."""
    import cv2
    return cv2.boundingRect(cv2.imread(str(file), cv2.IMREAD_GRAYSCALE))


def projected_box(scene, points):
    view, height = np.array(scene["camera"]["view"]), scene["height"]
    seen = points @ view[:3, :3].T + view[:3, 3]
    pixels = seen[:, :2] / -seen[:, 2:] * height / 2 / np.tan(np.radians(scene["camera"]["fov_y_degrees"]) / 2)
    corners = np.array([pixels.min(0), pixels.max(0)]) * [1, -1] + [scene["width"] / 2, height / 2]
    return *corners.min(0), *np.abs(corners[1] - corners[0])


def errors_of(pose, case, middle):
    """Of a pose, at the middle of the object, and what is said of it."""
    found = np.array(pose["rotation_matrix"])
    off = (found - case["rotation"]) @ middle + pose["translation"] - case["translation"]
    return {"degrees": float(angle_degrees(found, case["rotation"])), "off": float(np.linalg.norm(off)),
            "explained": pose["explained"], "unexplained_part": pose["unexplained_part"]}


def find_pose(arguments, file):
    case, scene = json.loads(file.read_text()), json.loads(file.with_suffix(".json").read_text())
    mask, random = file.with_suffix(".mask.png"), np.random.default_rng([*file.stem.encode(), arguments.degrees])
    points, rotation, place = np.array(scene["meshes"][0]["positions"]), np.array(case["rotation"]), case["translation"]
    middle, view = (points.min(0) + points.max(0)) / 2, np.array(scene["camera"]["view"])
    eye = -view[:3, :3].T @ view[:3, 3]
    axis = random.normal(size=3)
    start = turn(np.radians(arguments.degrees) * axis / np.linalg.norm(axis)) @ rotation
    there = eye + (rotation @ middle + place - eye) * (1 + 0.1 * random.choice([-1, 1]))
    scene["meshes"][0]["transform"] = affine(start, there - start @ middle).tolist()
    box = mask_box(mask) if mask.exists() else projected_box(scene, points @ rotation.T + place)
    options = case["options"][:case["options"].index("--mask")] if mask.exists() else case["options"]
    pose = run_pose(arguments, scene, picture_of(file), *options, "--box", ",".join(f"{side:.1f}" for side in box))
    return {"case": file.stem, **errors_of(pose, case, middle), "seconds": pose["seconds"]}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--dpr", default="dpr")
    parser.add_argument("--options", default="--unknown-background", help="of dpr pose, in one word")
    parser.add_argument("--degrees", type=int, default=10, help="that starts are off")
    parser.add_argument("-o", "--output", type=pathlib.Path, required=True)
    arguments = parser.parse_args()
    rows = []
    for file in sorted(arguments.folder.glob("*.case")):
        rows.append(find_pose(arguments, file))
        print(rows[-1], flush=True)
    for degrees in (1, 5):
        right = [row["explained"] for row in rows if row["degrees"] < degrees]
        print(f"{len(right)} of {len(rows)} below {degrees} degrees, {sum(right)} of them explained")
    print(sum(row["explained"] for row in rows), "explained in all")
    arguments.output.write_text(json.dumps(rows, indent=1) + "\n")


if __name__ == "__main__":
    main()
