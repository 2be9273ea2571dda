"""Makes project_points.json: points that OpenCV projects (pip install opencv-python-headless). No arguments."""

import json
import pathlib

import cv2
import numpy as np


def project(matrix, distortion, rotation, translation, points):
    fx, fy, cx, cy = matrix
    camera = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])
    arrays = [np.array(values) for values in (points, rotation, translation)]
    pixels, _ = cv2.projectPoints(*arrays, camera, np.array(distortion))
    return {
        "camera_matrix": matrix,
        "distortion": distortion,
        "rotation_vector": rotation,
        "translation": translation,
        "points": points,
        "pixels": [[round(float(u), 7), round(float(v), 7)] for u, v in pixels[:, 0]],
    }


def project_fisheye(matrix, coefficients, rotation, translation, points):
    fx, fy, cx, cy = matrix
    camera = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1.0]])
    arrays = [np.array(values, float)[:, None] for values in (points, rotation, translation)]
    pixels, _ = cv2.fisheye.projectPoints(*arrays, camera, np.array(coefficients))
    return {
        "camera_matrix": matrix,
        "fisheye": coefficients,
        "rotation_vector": rotation,
        "translation": translation,
        "points": points,
        "pixels": [[round(float(u), 7), round(float(v), 7)] for u, v in pixels[:, 0]],
    }


def fisheyes():
    """Points up to 88 degrees from the axis before cameras whose four coefficients all count; 200x150 pixels."""
    points = [[x, y, z] for x in (-2.5, 0.125, 1.75) for y in (-1.5, 0.25, 2.0) for z in (-0.5, 0.75)]
    return [
        project_fisheye([60.5, 58.25, 101.0, 71.5], [0.0625, -0.03125, 0.015625, -0.0078125], [0.25, -0.125, 0.125],
                        [0.125, -0.25, 1.375], points),
        project_fisheye([64.0, 60.0, 92.0, 80.0], [-0.0625, 0.0078125, 0.00390625, -0.001953125], [-0.125, 0.25, -1.0],
                        [-0.25, 0.0, 1.5], points),
        project_fisheye([60.0, 60.0, 99.5, 74.5], [0.0] * 4, [0.0, 3.0, 0.25], [0.0, 0.125, 1.25], points),
    ]


def lenses():
    """Points before cameras whose five coefficients all count; 200x150 pixels."""
    steps = ((-0.75, 0.125, 0.875), (-0.625, 0.25, 0.75), (-0.5, 0.5))
    points = [[x, y, z] for x in steps[0] for y in steps[1] for z in steps[2]]
    barrel = [-0.3125, 0.125, 0.015625, -0.03125, 0.0625]
    pincushion = [0.25, -0.125, -0.015625, 0.0078125, 0.03125]
    return [
        project([130.5, 128.25, 101.0, 71.5], barrel, [0.5, -0.25, 0.125], [0.125, -0.25, 3.0], points),
        project([160.0, 150.0, 92.0, 80.0], pincushion, [-0.375, 0.5, -1.0], [-0.25, 0.0, 3.5], points),
        project([140.0, 140.0, 99.5, 74.5], [0.0] * 5, [0.0, 3.0, 0.25], [0.0, 0.125, 2.75], points),
    ]


def boards():
    """The corners of a board of 8x6 squares in six views of one camera; 96x72 pixels."""
    points = [[0.25 * (column - 4), 0.25 * (row - 3), 0.0] for row in range(7) for column in range(9)]
    matrix, distortion = [90.0, 88.0, 48.5, 34.5], [-0.25, 0.0625, 0.0, 0.0, 0.0]
    poses = [
        ([0.0, 0.0, 0.125], [0.0, 0.0, 2.5]),
        ([0.625, 0.125, 0.0], [0.125, 0.0, 2.25]),
        ([-0.625, 0.0, -0.125], [-0.125, 0.125, 2.375]),
        ([0.125, 0.75, 0.0], [0.0, -0.125, 2.25]),
        ([0.0, -0.75, 0.25], [0.0, 0.0, 2.375]),
        ([0.5, 0.5, -0.25], [0.0, 0.0, 2.5]),
    ]
    return [project(matrix, distortion, *pose, points) for pose in poses]


def text(cases):
    return "[\n" + ",\n".join(map(json.dumps, cases)) + "\n]"


if __name__ == "__main__":
    file = pathlib.Path(__file__).with_name("project_points.json")
    version = json.dumps(cv2.__version__)
    file.write_text(f'{{"opencv": {version},\n"lenses": {text(lenses())},\n"boards": {text(boards())},\n'
                    f'"fisheyes": {text(fisheyes())}}}\n')
