"""How true the deviations and the verdicts of `dpr pose` are, on pictures that it did not make.

    python -m venv venv && venv/bin/pip install mitsuba numpy pillow opencv-python-headless
    venv/bin/python uncertainty.py pictures FOLDER --scenes tests/data/foreign/{bag,fish,spot}.json
    venv/bin/python uncertainty.py photographs FOLDER --data examples/data      # of Debian's opencv-doc
    venv/bin/python uncertainty.py poses FOLDER --dpr build/release/bin/dpr -o uncertainty.json
    venv/bin/python uncertainty.py together FOLDER --dpr build/release/bin/dpr -o calibration.json

`pictures` path-traces meshes in unknown light with Mitsuba 3 (see foreign.py) and spoils them as cameras do: noise,
blur, JPEG, clutter behind and something in front. `photographs` makes a board of coloured faces for each photograph
of a chessboard, with the truth of OpenCV's calibration. Both write cases: NAME.json is the scene, NAME.png or .jpg
the target, NAME.case the true pose. `poses` starts near the truth and compares errors with claimed deviations; then half
a turn away, where wrong poses come out, to see which are called explained. `together` finds the photographs' poses and
camera from 20 degrees and a tenth of the distance off, with the focal length right, a tenth too long, and without a lens.
"""
import argparse
import io
import json
import pathlib
import subprocess
import tempfile

import numpy as np

from foreign import angle_degrees, path_trace, picture_of, run_pose, uniform_rotation


def turn(vector):
    """The rotation by a vector, radians."""
    angle = np.linalg.norm(vector)
    x, y, z = vector / max(angle, 1e-12)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def affine(rotation, translation):
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = rotation, translation
    return matrix


def write_case(folder, name, scene, rotation, translation, options, kind, covariance=np.zeros((6, 6))):
    """The covariance is that of the truth."""
    scene["meshes"][0]["transform"] = affine(rotation, translation).tolist()
    (folder / f"{name}.json").write_text(json.dumps(scene))
    (folder / f"{name}.case").write_text(json.dumps(
        {"rotation": np.asarray(rotation).tolist(), "translation": np.asarray(translation).tolist(),
         "options": options, "kind": kind, "covariance": covariance.tolist()}))


# ---- Pictures ----

def grid_faces(rows, columns, first=0):
    """Two triangles for each cell of a grid of vertices."""
    faces = []
    for i in range(rows - 1):
        for j in range(columns - 1):
            a = first + i * columns + j
            faces += [[a, a + 1, a + columns + 1], [a, a + columns + 1, a + columns]]
    return faces


def mug():
    """A mug of one colour, dark inside: half a turn about several axes changes little but the handle and the inside."""
    around = np.linspace(0, 2 * np.pi, 49)
    profile = [(0, -1), (1, -1), (1, 1), (0.9, 1), (0.9, -0.9), (0, -0.9)]
    body = [[r * np.cos(a), h, r * np.sin(a)] for r, h in profile for a in around]
    faces = grid_faces(len(profile), len(around))
    colors = [[0.7, 0.65, 0.6]] * (2 * 3 * 48) + [[0.35, 0.3, 0.28]] * (2 * 2 * 48)
    bow, tube = np.linspace(-np.pi / 2, np.pi / 2, 25), np.linspace(0, 2 * np.pi, 13)
    handle = [[0.97 + (0.6 + 0.12 * np.cos(t)) * np.cos(b), (0.6 + 0.12 * np.cos(t)) * np.sin(b), 0.12 * np.sin(t)]
              for b in bow for t in tube]
    bows = grid_faces(len(bow), len(tube), len(body))
    return {"positions": np.array(body + handle).tolist(), "faces": faces + bows,
            "face_colors": colors + [[0.7, 0.65, 0.6]] * len(bows)}


def blurred(image, width):
    if width == 0:
        return image
    reach = int(np.ceil(3 * width))
    kernel = np.exp(-0.5 * (np.arange(-reach, reach + 1) / width) ** 2)
    kernel /= kernel.sum()
    for axis in (0, 1):
        image = np.apply_along_axis(lambda line: np.convolve(np.pad(line, reach, "edge"), kernel, "valid"), axis, image)
    return image


def smooth_noise(random, height, width, cell):
    """Blobs of colours, each of about `cell` pixels."""
    coarse = random.uniform(0, 0.6, 3) * random.uniform(0.2, 1, (height // cell + 3, width // cell + 3, 3))
    return blurred(np.kron(coarse, np.ones((cell, cell, 1)))[:height, :width], cell / 3)


def encoded(linear):
    x = np.clip(linear, 0, 1)
    return np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1 / 2.4) - 0.055)


def save(path, linear, quality):
    """As sRGB: PNG, or JPEG of a quality."""
    from PIL import Image
    image = Image.fromarray(np.round(255 * encoded(linear)).astype(np.uint8))
    image.save(path.with_suffix(".jpg" if quality else ".png"), **({"quality": quality} if quality else {}))


def add_clutter(random, image, coverage):
    return image + (1 - coverage) * smooth_noise(random, *image.shape[:2], int(random.integers(12, 40)))


def hide(random, image, coverage, least, most):  # part of the object, by a square of one colour
    rows, columns = np.nonzero(coverage[..., 0] > 0.5)
    i = random.integers(len(rows))
    side = int(np.sqrt(len(rows) * random.uniform(least, most)))
    image[max(rows[i] - side // 2, 0):rows[i] + side // 2 + 1,
          max(columns[i] - side // 2, 0):columns[i] + side // 2 + 1] = random.uniform(0, 1, 3)


def spoil(random, kind, image, coverage):
    """What cameras and rooms do to a picture. Returns it with its quality as JPEG, 0: none."""
    if kind == "clutter":
        image = add_clutter(random, image, coverage)
        hide(random, image, coverage, 0.05, 0.2)
    image = blurred(image, random.uniform(0.4, 1.0) if kind in ("blur", "camera") else 0)
    if kind in ("noise", "camera"):
        image = image + random.normal(size=image.shape) * random.uniform(0.005, 0.03)
    return image, int(random.integers(50, 95)) if kind in ("jpeg", "camera") else 0


KINDS = ("clean", "noise", "blur", "jpeg", "camera", "clutter")


def make_pictures(arguments):
    import mitsuba as mi
    mi.set_variant(arguments.variant)
    arguments.folder.mkdir(parents=True, exist_ok=True)
    scenes = {file.stem: json.loads(file.read_text()) for file in arguments.scenes}
    first = next(iter(scenes.values()))
    scenes["mug"] = dict(first, meshes=[mug()])
    for stem, scene in scenes.items():
        random = np.random.default_rng([arguments.seed, *stem.encode()])
        for view in range(arguments.count):
            kind = arguments.kinds[view % len(arguments.kinds)]
            rotation, translation = uniform_rotation(random), random.uniform(-0.4, 0.4, 3)
            size = int(random.choice([96, 128, 160]))
            sized = dict(scene, width=size, height=size)
            mesh = dict(scene["meshes"][0])
            if view // len(arguments.kinds) % 4 == 3:  # one colour
                mesh.pop("vertex_colors", None)
                mesh["face_colors"] = [[0.6, 0.6, 0.6]] * len(mesh["faces"])
            moved = dict(mesh, positions=(np.array(mesh["positions"]) @ rotation.T + translation).tolist())
            image = np.array(path_trace(mi, dict(sized, meshes=[moved]), np.eye(3), random, arguments.samples,
                                        view + view // len(arguments.kinds), "rgba"))
            image, coverage = image[..., :3], image[..., 3:]
            image *= random.uniform(0.5, 0.9) / np.quantile(image[coverage[..., 0] > 0.5], 0.98)  # an exposure
            image, quality = spoil(random, kind, image, coverage)
            options = ["--translation"] + (["--robust"] if kind == "clutter" else [])
            name = f"{stem}{view:02}"
            save(arguments.folder / name, image, quality)
            write_case(arguments.folder, name, dict(sized, meshes=[mesh]), rotation, translation, options, kind)
        print(stem, flush=True)


# ---- Photographs ----

SQUARES, MARGIN = (10, 7), 0.4  # of the board, whose outer squares are cut; part of these that is seen and counts


def board_mesh():
    """Squares of side 1 about the inner corners, the first of which is the origin; black and white, +z towards the camera."""
    lines = [np.r_[-MARGIN - 0.2, np.arange(n - 1), n - 2 + MARGIN + 0.2] for n in SQUARES]
    mesh = {"positions": [], "faces": [], "face_colors": []}
    for i in range(SQUARES[0]):
        for j in range(SQUARES[1]):
            first = len(mesh["positions"])
            mesh["positions"] += [[x, y, 0] for x, y in ((lines[0][i], lines[1][j]), (lines[0][i + 1], lines[1][j]),
                                                         (lines[0][i + 1], lines[1][j + 1]), (lines[0][i], lines[1][j + 1]))]
            mesh["faces"] += [[first, first + 1, first + 2], [first, first + 2, first + 3]]
            mesh["face_colors"] += [[0.02 if (i + j) % 2 == 0 else 0.9] * 3] * 2
    return mesh


def calibrate(cv2, images):
    """Intrinsics and lens, and each board's pose with its covariance in this camera, by OpenCV, without the corners
    that are far off: some are, in oblique views."""
    points = np.zeros((54, 3), np.float32)
    points[:, :2] = np.mgrid[0:9, 0:6].T.reshape(-1, 2)
    criteria = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 30, 1e-3)
    seen = []
    for image in images:
        found = cv2.findChessboardCorners(image, (9, 6))[1]
        seen.append((points, cv2.cornerSubPix(image, found, (5, 5), (-1, -1), criteria).reshape(-1, 2)))
    for last in (False, False, True):
        _, matrix, lens, turns, places = cv2.calibrateCamera([p for p, _ in seen], [c for _, c in seen],
                                                             images[0].shape[::-1], None, None)
        poses, kept = [], []
        for (p, c), turned, place in zip(seen, turns, places):
            projected, jacobian = cv2.projectPoints(p, turned, place, matrix, lens)
            off = c - projected.reshape(-1, 2)
            variance = (off ** 2).sum() / (2 * len(p) - 6)
            poses.append((turned, place, variance * np.linalg.inv(jacobian[:, :6].T @ jacobian[:, :6])))
            good = np.linalg.norm(off, axis=1) < 4 * np.median(np.linalg.norm(off, axis=1))
            kept.append((p[good], c[good]))
        seen = seen if last else kept
    return matrix, lens.ravel(), poses


def make_photographs(arguments):
    import cv2
    arguments.folder.mkdir(parents=True, exist_ok=True)
    files = sorted(arguments.data.glob("left*.jpg"))
    images = [cv2.imread(str(file), cv2.IMREAD_GRAYSCALE) for file in files]
    matrix, lens, poses = calibrate(cv2, images)
    part, to_opengl = arguments.reduce, np.diag([1.0, -1, -1])
    ends = [[-MARGIN, n - 2 + MARGIN] for n in SQUARES]
    outline = np.array([[ends[0][i], ends[1][j], 0] for i, j in ((0, 0), (1, 0), (1, 1), (0, 1))])
    for file, image, (turned, place, covariance) in zip(files, images, poses):
        polygon, _ = cv2.projectPoints(outline, turned, place, matrix, lens)
        mask = cv2.fillPoly(np.zeros_like(image), [np.round(polygon).astype(np.int32)], 255)
        height, width = (side // part for side in image.shape)
        for suffix, pixels in ((".png", image), (".mask.png", mask)):
            small = cv2.resize(pixels, (width, height), interpolation=cv2.INTER_AREA)
            cv2.imwrite(str(arguments.folder / (file.stem + suffix)), small)
        scene = {"width": width, "height": height, "meshes": [board_mesh()],
                 "camera": {"view": np.eye(4).tolist(), "znear": 1, "zfar": 100, "distortion": lens.tolist(),
                            "intrinsics": {"fx": matrix[0, 0] / part, "fy": matrix[1, 1] / part,
                                           "cx": (matrix[0, 2] + 0.5) / part, "cy": (matrix[1, 2] + 0.5) / part}}}
        rotation, derivative = cv2.Rodrigues(turned)
        # From rotation vectors, as OpenCV adds to them, to those on the left of the matrix; then OpenGL's axes.
        left = np.array([(lambda m: [m[2, 1], m[0, 2], m[1, 0]])(row.reshape(3, 3) @ rotation.T) for row in derivative]).T
        to = np.zeros((6, 6))
        to[:3, :3], to[3:, 3:] = to_opengl @ left, to_opengl
        options = ["--translation", "--light", "gain", "--mask", str((arguments.folder / (file.stem + ".mask.png")).resolve())]
        write_case(arguments.folder, file.stem, scene, to_opengl @ rotation, to_opengl @ place.ravel(), options,
                   "photograph", to @ covariance @ to.T)


# ---- Poses ----

def rotation_vector(rotation):
    angle = np.radians(angle_degrees(np.eye(3), rotation))
    axis = np.array([rotation[2, 1] - rotation[1, 2], rotation[0, 2] - rotation[2, 0], rotation[1, 0] - rotation[0, 1]])
    return axis / 2 * (angle / np.sin(angle) if angle > 1e-6 else 1)


def find_pose(arguments, case, scene_file, rotation, translation):
    """Of `dpr pose` from there."""
    scene = json.loads(scene_file.read_text())
    scene["meshes"][0]["transform"] = affine(rotation, translation).tolist()
    return run_pose(arguments, scene, picture_of(scene_file), "--rotations", "0", *case["options"])


def half_turns(scene):
    """About the mesh's axes of inertia."""
    points = np.array(scene["meshes"][0]["positions"])
    _, axes = np.linalg.eigh(np.cov(points.T))
    return [2 * np.outer(axis, axis) - np.eye(3) for axis in axes.T]


def compare(case, pose):
    """Errors of a pose, and in claimed deviations."""
    rotation = rotation_vector(np.array(pose["rotation_matrix"]) @ np.array(case["rotation"]).T)
    translation = np.array(pose["translation"]) - case["translation"]
    row = {"kind": case["kind"], "explained": pose["explained"], "loss": pose["loss"], "seconds": pose["seconds"],
           "degrees": float(np.degrees(np.linalg.norm(rotation))), "translation": float(np.linalg.norm(translation))}
    if pose["covariance"]:
        variance = np.diag(pose["covariance"])[:6] + np.diag(case["covariance"])
        row["claimed_degrees"] = float(np.degrees(np.sqrt(variance[:3].sum())))
        row["claimed_translation"] = float(np.sqrt(variance[3:].sum()))
        row["deviations"] = (np.r_[rotation, translation] / np.sqrt(variance)).tolist()
    return row


def find_poses(arguments):
    rows = []
    for file in sorted(arguments.folder.glob("*.case")):
        case, scene_file = json.loads(file.read_text()), file.with_suffix(".json")
        random = np.random.default_rng(list(file.stem.encode()))
        true_rotation, true_place = np.array(case["rotation"]), np.array(case["translation"])
        near = turn(np.radians(3) * uniform_rotation(random)[0])
        starts = [near] if not arguments.wrong else [true_rotation @ half @ true_rotation.T for half in half_turns(json.loads(scene_file.read_text()))]
        for start in starts:
            pose = find_pose(arguments, case, scene_file, start @ true_rotation, true_place + (0 if arguments.wrong else random.normal(size=3) * 0.03))
            rows.append({"case": file.stem, **compare(case, pose)})
            print(rows[-1], flush=True)
    arguments.output.write_text(json.dumps(rows, indent=1) + "\n")
    summarize(rows)


# ---- Photographs together ----

MIDDLE = np.array([(SQUARES[0] - 2) / 2, (SQUARES[1] - 2) / 2, 0])  # of the board, about which starts are turned


def view_of(file, camera, degrees):
    """Of a views file: the photograph, and a camera in front of which the board begins that far off."""
    case, random = json.loads(file.read_text()), np.random.default_rng([*file.stem.encode(), degrees])
    axis = random.normal(size=3)
    rotation = turn(np.radians(degrees) * axis / np.linalg.norm(axis)) @ case["rotation"]
    place = (np.array(case["rotation"]) @ MIDDLE + case["translation"]) * (1 + 0.1 * random.choice([-1, 1]))
    start = dict(camera, view=affine(rotation, place - rotation @ MIDDLE).tolist())
    return {"image": str(file.with_suffix(".png").resolve()), "mask": str(file.with_suffix(".mask.png").resolve()),
            "initial_camera": start}


def find_together(arguments):
    files = sorted(arguments.folder.glob("*.case"))
    scene = json.loads(files[0].with_suffix(".json").read_text())
    scene["meshes"][0].pop("transform")
    truth, results = scene["camera"], []
    for name, factor, options in (("camera known", 1, []), ("focal length", 1.1, ["--focal"]),
                                  ("focal length and lens", 1.1, ["--focal", "--distortion"])):
        camera = dict(truth, intrinsics={key: value * (factor if key[0] == "f" else 1)
                                         for key, value in truth["intrinsics"].items()})
        if "--distortion" in options:
            camera.pop("distortion")
        views = [view_of(file, camera, arguments.degrees) for file in files]
        with tempfile.TemporaryDirectory() as folder:
            scene_file, views_file, output = (pathlib.Path(folder) / n for n in ("scene.json", "views.json", "pose.json"))
            scene_file.write_text(json.dumps(dict(scene, camera=camera)))
            views_file.write_text(json.dumps({"width": scene["width"], "height": scene["height"], "views": views}))
            subprocess.run([arguments.dpr, "pose", "--scene", scene_file, "--views", views_file, "--moving", "--translation",
                            "--light", "gain", "--quiet", "-o", output, *options], check=True)
            found = json.loads(output.read_text())
        rows = []
        for file, view, pose in zip(files, views, found["views"]):
            case, to_camera = json.loads(file.read_text()), np.array(view["initial_camera"]["view"])
            rotation = to_camera[:3, :3] @ pose["rotation_matrix"]
            place = to_camera[:3, :3] @ pose["translation"] + to_camera[:3, 3]
            rows.append({"case": file.stem, "explained": pose["explained"],
                         "degrees": float(angle_degrees(rotation, np.array(case["rotation"]))),
                         "translation": float(np.linalg.norm(place - case["translation"]))})
        result = {"start": name, "focal_error": found["focal_scale"] * factor - 1, "views": rows}
        if "--distortion" in options:
            result["k1_error"] = found["views"][0]["distortion"][0] / truth["distortion"][0] - 1
        results.append(result)
        print(name, f"{sum(row['degrees'] < 0.5 for row in rows)} of {len(rows)} below 0.5 degrees, largest "
              f"{max(row['degrees'] for row in rows):.2f} and {max(row['translation'] for row in rows):.3f} squares,",
              {key: f"{value:.4f}" for key, value in result.items() if key.endswith("error")}, flush=True)
    arguments.output.write_text(json.dumps(results, indent=1) + "\n")


def summarize(rows):
    for kind in sorted({row["kind"] for row in rows}) + ["all"]:
        of_kind = [row for row in rows if kind in ("all", row["kind"])]
        right = [row for row in of_kind if row["degrees"] < 8]
        known = [row for row in right if "deviations" in row]
        line = f"{kind:12} right {len(right):3} explained {sum(r['explained'] for r in right):3}; " \
               f"wrong {len(of_kind) - len(right):3} explained {sum(r['explained'] for r in of_kind if r not in right):3};"
        for name, part in (("rotation", slice(0, 3)), ("translation", slice(3, 6))):
            size = np.abs([row["deviations"][part] for row in known])
            whole = np.array([row["degrees" if name == "rotation" else "translation"] / row["claimed_" + ("degrees" if name == "rotation" else "translation")] for row in known])
            if len(known):
                line += f" {name} axes {np.mean(size < 1):.0%} {np.mean(size < 2):.0%} whole {np.mean(whole < 1):.0%} {np.mean(whole < 2):.0%}"
                line += f" median {np.median(whole):.2f}"
        print(line)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(required=True)
    pictures = commands.add_parser("pictures")
    pictures.set_defaults(run=make_pictures)
    pictures.add_argument("--scenes", type=pathlib.Path, nargs="+", required=True,
                          help="each with a mesh of its own inline, and a perspective camera")
    pictures.add_argument("--samples", type=int, default=64, help="a pixel")
    pictures.add_argument("--seed", type=int, default=1)
    pictures.add_argument("--count", type=int, default=24, help="pictures of each mesh")
    pictures.add_argument("--kinds", nargs="+", choices=KINDS, default=KINDS, help="how they are spoilt, in turn")
    pictures.add_argument("--variant", default="llvm_ad_rgb", help="of Mitsuba")
    photographs = commands.add_parser("photographs")
    photographs.set_defaults(run=make_photographs)
    photographs.add_argument("--data", type=pathlib.Path, required=True, help="folder of left01.jpg to left14.jpg")
    photographs.add_argument("--reduce", type=int, default=2, help="part of the photographs' size")
    poses = commands.add_parser("poses")
    poses.set_defaults(run=find_poses)
    poses.add_argument("--dpr", default="dpr")
    poses.add_argument("--options", default="", help="further ones of dpr pose, in one word")
    poses.add_argument("--wrong", action="store_true", help="start half a turn away")
    poses.add_argument("-o", "--output", type=pathlib.Path, required=True)
    together = commands.add_parser("together")
    together.set_defaults(run=find_together)
    together.add_argument("--dpr", default="dpr")
    together.add_argument("--degrees", type=int, default=20, help="that starts are off")
    together.add_argument("-o", "--output", type=pathlib.Path, required=True)
    for command in (pictures, photographs, poses, together):
        command.add_argument("folder", type=pathlib.Path)
    arguments = parser.parse_args()
    arguments.run(arguments)


if __name__ == "__main__":
    main()
