"""Cameras of the Python package `dpr`: where points are drawn, against the formulas that their sources document."""
import sys
import unittest

try:
    import numpy as np
except ImportError:
    print("skipped: no python3-numpy")
    sys.exit(0)

import dpr
from dpr import cameras
from scenes import FACES, TETRAHEDRON

WIDTH, HEIGHT = 48, 32
POINTS = np.array([[0.31, 0.42, 0.1], [-0.5, 0.15, -0.2], [0.1, -0.35, 0.3]])
EYE, TARGET, UP = np.array([0.9, 0.7, 3.2]), np.array([0.1, -0.05, 0.0]), np.array([0.1, 1.0, 0.2])


def pixel_of(point, views, intrinsics, width=WIDTH, height=HEIGHT):
    """Middle of the silhouette of a small triangle that faces the camera, pixels from the upper left corner."""
    triangle = point + 0.09 * np.array([[0.0, 1.0], [1.0, -0.5], [-1.0, -0.5]]) @ views[0, :2, :3]
    alpha = dpr.render(triangle, [[0, 1, 2]], views, intrinsics, width=width, height=height, blur=0.7,
                       supersampling=4)[0, ..., 3]
    assert alpha.sum() > 0.5
    return np.array([(alpha.sum(0) * (np.arange(width) + 0.5)).sum(), (alpha.sum(1) * (np.arange(height) + 0.5)).sum()]) \
        / alpha.sum()


def normalized(vector):
    return vector / np.linalg.norm(vector)


def rotation(seed):
    q, r = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    q = q * np.sign(np.diag(r))
    return q * np.sign(np.linalg.det(q))


def modelview():
    """As gluLookAt documents it."""
    forward = normalized(TARGET - EYE)
    side = normalized(np.cross(forward, normalized(UP)))
    matrix = np.eye(4)
    matrix[:3, :3] = side, np.cross(side, forward), -forward
    return matrix @ np.block([[np.eye(3), -EYE[:, None]], [np.zeros((1, 3)), 1]])


def glu_perspective(fov, near=1.0, far=10.0):
    f = 1 / np.tan(np.radians(fov) / 2)
    return np.array([[f * HEIGHT / WIDTH, 0, 0, 0], [0, f, 0, 0],
                     [0, 0, (far + near) / (near - far), 2 * far * near / (near - far)], [0, 0, -1, 0]])


def window(clip):
    """OpenGL's viewport transform, with the upper row first."""
    ndc = clip[:2] / clip[3]
    return np.array([(1 + ndc[0]) / 2 * WIDTH, (1 - ndc[1]) / 2 * HEIGHT])


class CamerasTest(unittest.TestCase):
    def assert_at(self, expected, point, views, intrinsics, **size):
        found = pixel_of(point, views, intrinsics, **size)
        np.testing.assert_allclose(found, expected, atol=0.06)

    def test_look_at_and_perspective(self):
        views, intrinsics = dpr.look_at(EYE, TARGET, UP), dpr.perspective(35, WIDTH, HEIGHT)
        np.testing.assert_allclose(views, modelview()[None], atol=1e-12)
        for point in POINTS:
            self.assert_at(window(glu_perspective(35) @ modelview() @ [*point, 1]), point, views, intrinsics)
        self.assertEqual(dpr.look_at([0, 0, 4]).dtype, np.float32)
        self.assertEqual(dpr.look_at(np.zeros((5, 3)) + [0, 1, 4]).shape, (5, 4, 4))
        self.assertEqual(dpr.perspective([30, 60], 8, 8).shape, (2, 4))
        for wrong, words in ((([0, np.nan, 0],), r"eye .*got infinity or NaN"), ((EYE, [np.inf, 0, 0]), "target .*got inf"),
                             ((np.eye(3)[:2], 5 + np.eye(3)), r"eye .*got \[2, 3\], expected .*\[3, 3\]")):
            with self.assertRaisesRegex(ValueError, words):
                dpr.look_at(*wrong)
        for call in (lambda *size: dpr.perspective(35, *size), lambda *size: cameras.from_opengl(glu_perspective(35), *size),
                     lambda *size: cameras.from_pytorch3d(np.eye(3), [0, 0, 4], *size, fov_degrees=35),
                     lambda width, height: cameras.from_softras(EYE, width if height == 64 else height)):
            for size in ((-64, 64), (64, 0), (64, np.nan)):
                with self.assertRaisesRegex(ValueError, "(width|height|size) .*got .*, expected pixels, above 0"):
                    call(*size)
        for wrong in ((EYE, EYE), (EYE, TARGET, EYE - TARGET), (EYE, TARGET, [0, 0, 0]), (EYE[:2],)):
            with self.assertRaisesRegex(ValueError, "dpr.cameras"):
                dpr.look_at(*wrong)
        with self.assertRaisesRegex(TypeError, "'origin'.*lists of numbers"):
            dpr.look_at("origin")

    def test_from_opengl(self):
        off_centre = glu_perspective(40)
        off_centre[:2, 2] = 0.12, -0.2
        for projection in (glu_perspective(35), off_centre):
            for point in POINTS:
                clip = projection @ modelview() @ [*point, 1]
                self.assert_at(window(clip), point, modelview()[None], cameras.from_opengl(projection, WIDTH, HEIGHT))
        # nvdiffrast: row 0 is at y = -1 of clip space. Its samples turn y round.
        projection = off_centre * [[1], [-1], [1], [1]]
        for point in POINTS:
            clip = projection @ modelview() @ [*point, 1]
            row = (1 + clip[1] / clip[3]) / 2 * HEIGHT
            self.assert_at([window(clip)[0], row], point, modelview()[None],
                           cameras.from_opengl(projection, WIDTH, HEIGHT))
        orthographic = np.diag([HEIGHT / WIDTH / 1.1, 1 / 1.1, -0.2, 1])
        for point in POINTS:
            self.assert_at(window(orthographic @ modelview() @ [*point, 1]), point, modelview()[None],
                           cameras.from_opengl(orthographic, WIDTH, HEIGHT))
        skewed, shifted = off_centre.copy(), orthographic.copy()
        skewed[0, 1], shifted[0, 3] = 0.1, 0.1
        for wrong in (skewed, shifted, np.zeros((4, 4)), np.eye(3)):
            with self.assertRaisesRegex(ValueError, "projection"):
                cameras.from_opengl(wrong, WIDTH, HEIGHT)

    def test_from_opencv(self):
        R, K = np.diag([1.0, -1.0, -1.0]) @ modelview()[:3, :3], np.array([[50.0, 0, 22.3], [0, 46.0, 17.1], [0, 0, 1]])
        t = -R @ EYE
        for distortion in (None, np.array([-0.2, 0.05, 0.01, -0.02, 0.01])):
            for column in (t, t[:, None]):
                views, intrinsics = cameras.from_opencv(R, column, K, distortion)
            for point in POINTS:
                x, y, z = R @ point + t
                x, y = x / z, y / z
                if distortion is not None:
                    k1, k2, p1, p2, k3 = distortion
                    r2 = x * x + y * y
                    radial = 1 + k1 * r2 + k2 * r2**2 + k3 * r2**3
                    x, y = (x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
                            y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y)
                # Whole numbers are OpenCV's pixels' centres.
                self.assert_at([K[0, 0] * x + K[0, 2] + 0.5, K[1, 1] * y + K[1, 2] + 0.5], point, views, intrinsics)
        for lens in (distortion, distortion[:4]):
            for given in (lens[:, None], lens[None]):
                np.testing.assert_array_equal(cameras.from_opencv(R, t, K, given)[1], cameras.from_opencv(R, t, K, lens)[1])
        # Beside cv2.fisheye's own D, a column, and a batch.
        D = np.array([0.2, -0.1, 0.05, -0.02])
        for fisheye in (D, D[:, None], D[None]):
            views, intrinsics = cameras.from_opencv(R, t, K, fisheye=fisheye)
            self.assertEqual(intrinsics.shape, (1, 8))
        for point in POINTS:
            x, y, z = R @ point + t
            r = np.hypot(x, y) / z
            angle = np.arctan(r)
            factor = (angle + D @ angle ** np.array([3, 5, 7, 9])) / r / z
            self.assert_at([K[0, 0] * factor * x + K[0, 2] + 0.5, K[1, 1] * factor * y + K[1, 2] + 0.5], point, views,
                           intrinsics)
        with self.assertRaisesRegex(ValueError, "one of them"):
            cameras.from_opencv(R, t, K, D, fisheye=D)
        with self.assertRaisesRegex(ValueError, "fisheye.* 4 coefficients"):
            cameras.from_opencv(R, t, K, fisheye=np.zeros(5))
        four = cameras.from_opencv(R, t, K, [[0.1, 0.2, 0.3, 0.4]])[1]
        np.testing.assert_allclose(four[0, 4:], [0.1, 0.2, 0.3, 0.4, 0], rtol=1e-6)
        with self.assertRaisesRegex(ValueError, "skew"):
            cameras.from_opencv(R, t, K + [[0, 1, 0], [0, 0, 0], [0, 0, 0]])
        with self.assertRaisesRegex(ValueError, "coefficients"):
            cameras.from_opencv(R, t, K, np.zeros(8))

    def test_from_pytorch3d(self):
        # Rows times R; x to the left, y up, z forward.
        R = (np.diag([-1.0, 1.0, -1.0]) @ modelview()[:3, :3]).T
        T = -EYE @ R
        short = min(WIDTH, HEIGHT)

        def check(expected_of, **camera):
            views, intrinsics = cameras.from_pytorch3d(R, T, WIDTH, HEIGHT, **camera)
            for point in POINTS:
                self.assert_at(expected_of(*(point @ R + T)), point, views, intrinsics)

        def of_ndc(x, y):  # half of the short side is 1, x is to the left
            return [WIDTH / 2 - x * short / 2, HEIGHT / 2 - y * short / 2]

        f = 1 / np.tan(np.radians(50) / 2)
        check(lambda x, y, z: of_ndc(f * x / z, f * y / z), fov_degrees=50)
        check(lambda x, y, z: of_ndc(2.5 * x / z + 0.1, 2.2 * y / z - 0.2), focal_length=[[2.5, 2.2]],
              principal_point=[[0.1, -0.2]])
        check(lambda x, y, z: [20 - 40 * x / z, 18 - 40 * y / z], focal_length=40, principal_point=[[20, 18]],
              in_ndc=False)
        with self.assertRaisesRegex(ValueError, "one of them"):
            cameras.from_pytorch3d(R, T, WIDTH, HEIGHT)

    def test_from_softras(self):
        size, eye = 40, np.array([0.8, 1.2, -2.5])
        views, intrinsics = cameras.from_softras(eye, size, viewing_angle=20)
        z_axis = normalized(-eye)
        x_axis = normalized(np.cross([0, 1, 0], z_axis))
        y_axis = np.cross(z_axis, x_axis)
        for point in POINTS:
            x, y, z = np.array([x_axis, y_axis, z_axis]) @ (point - eye)
            width = np.tan(np.radians(20))
            expected = [(1 + x / z / width) / 2 * size, (1 - y / z / width) / 2 * size]
            self.assert_at(expected, point, views, intrinsics, width=size, height=size)

    def test_gradients_and_types_of_tensors(self):
        try:
            import torch
        except ImportError:
            self.skipTest("no torch")

        def loss(eye, fov):
            image = dpr.render(torch.tensor(TETRAHEDRON), torch.tensor(FACES), dpr.look_at(eye),
                               dpr.perspective(fov, WIDTH, HEIGHT), width=WIDTH, height=HEIGHT, blur=2, znear=1, zfar=8)
            ramp = torch.linspace(0, 1, WIDTH) + torch.linspace(0, 1, HEIGHT)[:, None]
            return (image[0, ..., 3].double() * ramp).sum()

        given = [torch.tensor([0.6, 0.4, 3.5], dtype=torch.float64, requires_grad=True),
                 torch.tensor(40.0, dtype=torch.float64, requires_grad=True)]
        self.assertEqual(dpr.look_at(given[0]).dtype, torch.float64)
        self.assertTrue(torch.autograd.gradcheck(loss, given, eps=1e-2, atol=0.2, rtol=2e-2))
        if hasattr(torch, "func"):
            eye = given[0].detach()
            for jacobian in (torch.func.jacrev, torch.func.jacfwd):
                found = jacobian(dpr.look_at)(eye)[0, 0]
                np.testing.assert_allclose(found, torch.autograd.functional.jacobian(dpr.look_at, eye)[0, 0], atol=1e-12)
        R, K = torch.tensor(rotation(3), requires_grad=True), torch.eye(3, dtype=torch.float64)
        for views, intrinsics in (cameras.from_opencv(R, [0, 0, 4], 30 * K), cameras.from_softras(given[0], 32),
                                  cameras.from_pytorch3d(R, [0, 0, 4], 32, 32, fov_degrees=given[1])):
            self.assertEqual((views.shape, intrinsics.shape), ((1, 4, 4), (1, 4)))
            self.assertTrue(views.requires_grad and views.dtype == torch.float64)
        self.assertTrue(cameras.from_opengl(torch.tensor(glu_perspective(35), requires_grad=True), 8, 8).requires_grad)

    def test_gradients_of_jax(self):
        try:
            import jax
        except ImportError:
            self.skipTest("no jax")

        def middle(eye):
            image = dpr.render(TETRAHEDRON, FACES, dpr.look_at(eye), dpr.perspective(40, WIDTH, HEIGHT), width=WIDTH,
                               height=HEIGHT, blur=2, znear=1, zfar=8)
            return (image[0, ..., 3] * np.linspace(0, 1, WIDTH, dtype=np.float32)).sum()

        eye, step = np.array([0.6, 0.4, 3.5], np.float32), np.array([0.01, 0, 0], np.float32)
        gradient = jax.jit(jax.grad(middle))(eye)
        difference = (middle(jax.numpy.asarray(eye + step)) - middle(jax.numpy.asarray(eye - step))) / 0.02
        self.assertAlmostEqual(float(gradient[0] / difference), 1, delta=0.02)
        for views, _ in (cameras.from_opencv(jax.numpy.eye(3), [0, 0, 4], np.eye(3)),
                         cameras.from_softras(jax.numpy.ones(3), 8)):
            self.assertIsInstance(views, jax.Array)


if __name__ == "__main__":
    unittest.main(verbosity=2)
