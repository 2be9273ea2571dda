"""Poses of photographs without masks, by `dpr pose --unknown-background`.

    venv/bin/python unmasked.py FOLDER --dpr build/release/bin/dpr -o unmasked.json

FOLDER has the photographs' cases of `uncertainty.py photographs`, whose venv this needs. Of each photograph a box
about the board is given; rotations are tried all around, and a start 10 degrees and a tenth of the distance off says
from which side the board is seen. Its border and the room behind are not in the scene.
"""
import argparse
import json
import pathlib
import subprocess
import tempfile

import cv2
import numpy as np

from foreign import angle_degrees
from uncertainty import MIDDLE, view_of


def find_pose(dpr, file, degrees):
    case, scene = json.loads(file.read_text()), json.loads(file.with_suffix(".json").read_text())
    scene["meshes"][0]["transform"] = view_of(file, scene["camera"], degrees)["initial_camera"]["view"]
    box = cv2.boundingRect(cv2.imread(str(file.with_suffix(".mask.png")), cv2.IMREAD_GRAYSCALE))
    with tempfile.TemporaryDirectory() as folder:
        start, output = pathlib.Path(folder) / "start.json", pathlib.Path(folder) / "pose.json"
        start.write_text(json.dumps(scene))
        subprocess.run([dpr, "pose", "--scene", start, "--target", file.with_suffix(".png"), "--translation", "--light", "gain",
                        "--unknown-background", "--box", ",".join(map(str, box)), "--quiet", "-o", output], check=True)
        pose = json.loads(output.read_text())
    rotation, true_rotation = np.array(pose["rotation_matrix"]), np.array(case["rotation"])
    off = (rotation - true_rotation) @ MIDDLE + pose["translation"] - case["translation"]
    return {"case": file.stem, "degrees": float(angle_degrees(rotation, true_rotation)), "squares": float(np.linalg.norm(off)),
            "explained": pose["explained"], "unexplained_part": pose["unexplained_part"], "seconds": pose["seconds"]}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--dpr", default="dpr")
    parser.add_argument("--degrees", type=int, default=10, help="that starts are off")
    parser.add_argument("-o", "--output", type=pathlib.Path, required=True)
    arguments = parser.parse_args()
    rows = []
    for file in sorted(arguments.folder.glob("*.case")):
        rows.append(find_pose(arguments.dpr, file, arguments.degrees))
        print(rows[-1], flush=True)
    print(f"{sum(row['degrees'] < 1 for row in rows)} of {len(rows)} below 1 degree")
    arguments.output.write_text(json.dumps(rows, indent=1) + "\n")


if __name__ == "__main__":
    main()
