"""What the tests of the Python package render, by NumPy alone."""
import numpy as np

SIZE = 16
FACES = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]])
# No side is seen edge-on, and no pixel lies as near to one edge as to another: the image has kinks there.
TETRAHEDRON = np.array([[0.11, 0.89, 0.21], [-0.79, -0.31, 0.51], [0.91, -0.49, 0.39], [0.06, 0.24, -0.91]], np.float32)
SQUARE = np.array([[-0.7, -0.6, 0.1], [0.8, -0.7, 0.0], [0.6, 0.7, -0.1], [-0.75, 0.65, 0.2], [0.0, 0.0, 0.3]],
                  np.float32)
SQUARE_FACES = np.array([[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4], [0, 2, 1]])
SMOOTH = {"preset": "joint_gaussian", "sigma": 5e-3, "gamma": 5e-2, "occupancy_threshold": 1e-6, "znear": 1, "zfar": 10}


def cameras(count):
    """Looking at the origin from +z, each a little further away."""
    views = np.tile(np.eye(4, dtype=np.float32), (count, 1, 1))
    views[:, 2, 3] = -4.0 - 0.3 * np.arange(count)
    return views, np.tile(np.array([20.0, 20.0, 8.1, 7.9], np.float32), (count, 1))


def random(*shape, seed=1):
    return np.random.default_rng(seed).random(shape, np.float32)


def textured(seed=6):
    """Arguments with two textures and materials, and lights."""
    return {"texcoords": 2 * random(5, 3, 2, seed=5) - 0.5,
            "textures": [random(5, 7, 3, seed=seed), random(4, 2, 3, seed=seed + 1)],
            "face_textures": np.array([0, 1, -1, 1, 0]), "wrap": ["mirror", "clamp"], "filter": ["trilinear", "bilinear"],
            "materials": {"specular": random(2, 3, seed=seed + 2), "shininess": np.array([3.0, 8.0], np.float32)},
            "face_materials": np.array([0, 1, 1, 0, 1]),
            "lights": {"ambient": np.array([0.2, 0.3, 0.4], np.float32),
                       "point": np.array([[2.0, 2.5, 4.0] + 3 * [0.5] + 3 * [0.4]], np.float32)}}
