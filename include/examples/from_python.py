"""From Python with NumPy alone: moves a triangle towards its image by gradient descent on its vertices."""
import numpy as np

import dpr

faces = np.array([[0, 1, 2]])
truth = np.array([[-1, -1, 0], [1, -1, 0], [0, 1, 0]], np.float32)
view = np.eye(4, dtype=np.float32)  # world to camera; the camera looks down -z
view[2, 3] = -3
intrinsics = np.array([[55, 55, 32, 32]], np.float32)  # fx, fy, cx, cy in pixels
renderer = dpr.Renderer(64, 64, preset="joint_gaussian", sigma=0.01)

target = renderer(truth, faces, view[None], intrinsics)  # [1, 64, 64, 4]
vertices = truth + np.float32(0.1)
first = None
for step in range(40):
    image, pullback = renderer.vjp(vertices, faces, view[None], intrinsics, wrt=["vertices"])
    difference = image - target
    loss = np.square(difference[..., :3]).mean()
    first = loss if first is None else first
    grad_image = 2 * difference / difference[..., :3].size
    grad_image[..., 3] = 0  # the loss does not look at alpha
    vertices = vertices - pullback(grad_image)["vertices"]
print(f"loss {first:g}, then {loss:g}")
assert loss < 0.1 * first
