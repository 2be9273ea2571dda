"""Poses of the objects in M3T's two frames (German Aerospace Center, MIT), by `dpr pose`.

    python -m venv venv && venv/bin/pip install numpy pillow
    venv/bin/python m3t.py FOLDER --dpr build/release/bin/dpr -o m3t.json --overlay m3t.png

FOLDER has M3T's test data: body_*.obj and .yaml, sequence_*_camera.yaml and their images, *_triangle_pose.txt. The green
triangle, a corner of which the bottle hides, starts 10 and 40 degrees and 10 mm off; errors are to the nearest of the
three poses that M3T's own tests have, which are up to 4 degrees and 9 mm apart. The bottle is searched in its box; the
frame's depth image, from a camera beside that of the picture, says how far away it is.
"""
import argparse
import json
import pathlib
import re
import subprocess
import tempfile

import numpy as np
from PIL import Image

from foreign import angle_degrees
from uncertainty import turn

TO_OPENGL = np.diag([1.0, -1, -1, 1])
COLORS = {"triangle": [0.25, 0.6, 0.05], "schauma": [0.8, 0.3, 0.02]}
BOXES = {"triangle": (362, 243, 70, 58), "schauma": (408, 122, 116, 286)}


def matrix_in(text):
    return np.array(re.search(r"data:\s*\[([^\]]*)\]", text)[1].split(","), float).reshape(4, 4)


class Camera:
    def __init__(self, file):
        text = file.read_text()
        number = lambda key: float(re.search(key + r":\s*([-\d.]+)", text)[1])
        # M3T's pixels have their centres at whole numbers.
        self.intrinsics = {"fx": number("f_u"), "fy": number("f_v"), "cx": number("pp_x") + 0.5, "cy": number("pp_y") + 0.5}
        self.width, self.height = int(number("width")), int(number("height"))
        self.to_world = matrix_in(text)


def poses_of_tests(folder):
    read = lambda file: np.array([line.split(",")[:4] for line in file.read_text().splitlines()[2:6]], float)
    return [read(file) for file in sorted(folder.glob("*_triangle_pose.txt"))]


def scene_of(folder, camera, name, transform):
    lines = [line.split() for line in (folder / f"body_{name}.obj").read_text().splitlines()]
    to_body = matrix_in((folder / f"body_{name}.yaml").read_text())
    vertices = np.array([line[1:4] for line in lines if line[:1] == ["v"]], float) @ to_body[:3, :3].T + to_body[:3, 3]
    faces = [[int(corner.split("/")[0]) - 1 for corner in line[1:4]] for line in lines if line[:1] == ["f"]]
    return {"width": camera.width, "height": camera.height,
            "camera": {"view": (TO_OPENGL @ np.linalg.inv(camera.to_world)).tolist(), "intrinsics": camera.intrinsics,
                       "znear": 0.1, "zfar": 5},
            "meshes": [{"positions": vertices.tolist(), "faces": faces, "face_colors": [COLORS[name]] * len(faces),
                        "transform": transform.tolist()}]}


def find(arguments, folder, name, start, options):
    """(pose, what dpr says of it)"""
    camera = Camera(arguments.folder / "sequence_color_camera.yaml")
    scene, output = folder / "scene.json", folder / "pose.json"
    scene.write_text(json.dumps(scene_of(arguments.folder, camera, name, start)))
    subprocess.run([arguments.dpr, "pose", "--scene", scene, "--target", arguments.folder / arguments.picture, "--translation",
                    "--unknown-background", "--box", ",".join(map(str, BOXES[name])), "--quiet", "-o", output, *options],
                   check=True)
    said = json.loads(output.read_text())
    return np.array(said["transform"]), {key: said[key] for key in ("explained", "unexplained_part", "seconds")}


def triangle(arguments, folder):
    truths, rows = poses_of_tests(arguments.folder), []
    for degrees in (10, 40):
        for seed in range(arguments.starts):
            random = np.random.default_rng(seed)
            axis, shift = (v / np.linalg.norm(v) for v in random.normal(size=(2, 3)))
            start = truths[0].copy()
            start[:3, :3] = turn(np.radians(degrees) * axis) @ start[:3, :3]
            start[:3, 3] += 0.01 * shift
            pose, said = find(arguments, folder, "triangle", start, ["--rotations", "0"])
            errors = [(angle_degrees(pose[:3, :3], truth[:3, :3]), 1000 * np.linalg.norm(pose[:3, 3] - truth[:3, 3]))
                      for truth in truths]
            rows.append({"start_degrees": degrees, "degrees": min(errors)[0], "millimetres": float(min(errors)[1]), **said})
            print(rows[-1], flush=True)
    return rows


def bottle(arguments, folder):
    start = np.eye(4)
    start[:3, 3] = 0, 0, 0.45
    pose, said = find(arguments, folder, "schauma", start, ["--search"])
    camera, depth_camera = (Camera(arguments.folder / f"sequence_{kind}_camera.yaml") for kind in ("color", "depth"))
    scene = scene_of(arguments.folder, camera, "schauma", pose)
    (folder / "found.json").write_text(json.dumps(scene))
    subprocess.run([arguments.dpr, "render", "--scene", folder / "found.json", "--preset", "rigid", "-o", folder / "found.png",
                    "--quiet"], check=True)
    shown = np.array(Image.open(folder / "found.png"))[..., :3].max(-1) > 0
    edge = shown ^ (np.roll(shown, 1, 0) & np.roll(shown, 1, 1) & np.roll(shown, -1, 0) & np.roll(shown, -1, 1) & shown)
    picture = np.array(Image.open(arguments.folder / arguments.picture).convert("RGB"))
    picture[edge] = 255, 0, 0
    x, y, width, height = BOXES["schauma"]
    Image.fromarray(picture[y - 40:y + height + 40, x - 60:x + width + 60]).resize((3 * (width + 120), 3 * (height + 80)),
                                                                                  Image.NEAREST).save(arguments.overlay)

    # Points of the depth image where the picture shows the bottle, in the world's axes, against the mesh's nearest vertices.
    depth = np.array(Image.open(arguments.folder / arguments.depth)) * 0.001
    rows, columns = np.nonzero((depth > 0.2) & (depth < 0.6))
    z, k = depth[rows, columns], depth_camera.intrinsics
    points = np.stack([(columns + 0.5 - k["cx"]) / k["fx"] * z, (rows + 0.5 - k["cy"]) / k["fy"] * z, z, np.ones_like(z)], -1)
    seen = points @ (np.linalg.inv(camera.to_world) @ depth_camera.to_world).T
    k = camera.intrinsics
    u = (seen[:, 0] / seen[:, 2] * k["fx"] + k["cx"]).astype(int)
    v = (seen[:, 1] / seen[:, 2] * k["fy"] + k["cy"]).astype(int)
    inside = (u > 0) & (u < camera.width) & (v > 0) & (v < camera.height)
    on_bottle = seen[inside][shown[v[inside], u[inside]]]
    vertices = np.array(scene["meshes"][0]["positions"]) @ pose[:3, :3].T + pose[:3, 3]
    front = vertices[np.argsort(vertices[:, 2])[:len(vertices) // 2]]
    sample = on_bottle[np.random.default_rng(0).choice(len(on_bottle), 500), :3]
    nearest = front[np.argmin(((sample[:, None] - front) ** 2).sum(-1), 1)]
    row = {"depth_median_millimetres": float(1000 * np.median((sample - nearest)[:, 2])), "points": len(on_bottle), **said}
    print(row)
    return row


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--dpr", default="dpr")
    parser.add_argument("--picture", default="sequence_color_camera_image_200.png")
    parser.add_argument("--depth", default="sequence_depth_camera_image_200.png")
    parser.add_argument("--starts", type=int, default=4, help="of the triangle, at each angle")
    parser.add_argument("--overlay", type=pathlib.Path, default="m3t.png", help="the bottle's outline over the picture")
    parser.add_argument("-o", "--output", type=pathlib.Path, required=True)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        result = {"triangle": triangle(arguments, folder), "bottle": bottle(arguments, folder)}
    arguments.output.write_text(json.dumps(result, indent=1) + "\n")


if __name__ == "__main__":
    main()
