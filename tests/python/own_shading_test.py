"""Shading of the caller's own in the Python package: the library's own colours, found by the caller, make its images and
gradients."""
import os
import subprocess
import sys
import tempfile
import unittest

try:
    import numpy as np
except ImportError:
    print("skipped: no python3-numpy")
    sys.exit(0)
try:
    import torch
except ImportError:
    torch = None

import dpr
from scenes import FACES, SIZE, TETRAHEDRON, cameras, random

COLORS = random(4, 3, seed=5)
WEIGHTS = random(2, SIZE, SIZE, 4, seed=3) - 0.5
BACKGROUND = np.float32([0.1, 0.2, 0.3])
RENDERER = dpr.Renderer(SIZE, SIZE, blur=0.6, gamma=1e-7)


def shaded(samples, colors):
    """RGBA of the samples, and the mask."""
    mask = samples.mask[..., None]
    return np.concatenate([np.where(mask, samples.interpolate(colors), BACKGROUND), mask], -1).astype(np.float32)


class OwnShadingTest(unittest.TestCase):
    def setUp(self):
        self.views, self.intrinsics = cameras(2)

    def arguments(self, vertices=TETRAHEDRON):
        return vertices, FACES, self.views, self.intrinsics

    def check_close(self, found, expected, tolerance):
        found, expected = np.asarray(found), np.asarray(expected)
        self.assertEqual(found.shape, expected.shape)
        self.assertGreater(np.abs(expected).max(), 0)
        self.assertLess(np.abs(found - expected).max() / np.abs(expected).max(), tolerance)

    def test_samples(self):
        samples = RENDERER.rasterize(*self.arguments())
        size = samples.supersampling * SIZE + 2 * samples.margin
        self.assertEqual(samples.face_id.shape, (2, size, size))
        self.assertTrue(((samples.face_id == -1) == (samples.depth == 0)).all())
        self.assertLess(np.abs(samples.barycentrics.sum(-1) - samples.mask).max(), 1e-5)
        depths = -(TETRAHEDRON @ self.views[:, 2, :3].T + self.views[:, 2, 3]).T[..., None]  # [N, V, 1]
        self.assertLess(np.abs(samples.interpolate(depths)[..., 0] - samples.depth).max(), 1e-4)
        corners = samples.interpolate(COLORS[FACES].reshape(-1, 3), np.arange(12).reshape(4, 3))
        self.assertTrue((corners == samples.interpolate(COLORS)).all())

    def test_images_and_gradients_are_the_librarys(self):
        for vertices in (TETRAHEDRON, np.stack([TETRAHEDRON, 0.8 * TETRAHEDRON])):
            arguments = {"colors": COLORS, "background": BACKGROUND, "wrt": ["vertices", "views", "intrinsics"]}
            image, pullback = RENDERER.vjp(*self.arguments(vertices), **arguments)
            wanted = pullback(WEIGHTS)
            samples = RENDERER.rasterize(*self.arguments(vertices))
            found, own_pullback = samples.resolve_with_vjp(shaded(samples, COLORS))
            self.check_close(found, image, 1e-5)
            grad_values, by_contours = own_pullback(WEIGHTS)
            corners = COLORS[FACES[samples.face_id.clip(0)]]
            grad_barycentrics = (corners * grad_values[..., None, :3]).sum(-1) * samples.mask[..., None]
            inside = samples.pullback(barycentrics=grad_barycentrics)
            for name, gradient in wanted.items():
                with self.subTest(name):
                    self.check_close(by_contours[name] + inside[name], gradient, 1e-4)

    @unittest.skipUnless(torch, "no PyTorch")
    def test_pytorch(self):
        tensors = [torch.from_numpy(array).requires_grad_() for array in (TETRAHEDRON.copy(), self.views, self.intrinsics)]
        colors = torch.from_numpy(COLORS.copy()).requires_grad_()
        vertices, views, intrinsics = tensors
        faces, weights = torch.from_numpy(FACES), torch.from_numpy(WEIGHTS)
        image = RENDERER(vertices, faces, views, intrinsics, colors=colors)
        (image * weights).sum().backward()
        wanted = [tensor.grad for tensor in (*tensors, colors)]
        for tensor in (*tensors, colors):
            tensor.grad = None
        samples = RENDERER.rasterize(vertices, faces, views, intrinsics)
        values = torch.cat([samples.interpolate(colors), samples.mask[..., None].float()], -1)
        found = samples.resolve(values)
        (found * weights).sum().backward()
        self.check_close(found.detach(), image.detach(), 1e-5)
        for tensor, gradient in zip((*tensors, colors), wanted):
            self.check_close(tensor.grad, gradient, 1e-4)

    @unittest.skipUnless(torch, "no PyTorch")
    def test_gradients_of_depths(self):
        vertices = torch.from_numpy(TETRAHEDRON.copy()).requires_grad_()
        views, intrinsics = map(torch.from_numpy, cameras(2))
        faces = torch.from_numpy(FACES)
        samples = RENDERER.rasterize(vertices, faces, views, intrinsics)
        samples.depth.sum().backward()
        # The same by barycentrics: depths are interpolated with perspective.
        found, vertices.grad = vertices.grad, None
        samples = RENDERER.rasterize(vertices, faces, views, intrinsics)
        depths = -(vertices @ views[:, 2, :3, None] + views[:, None, 2, 3:])
        samples.interpolate(depths).sum().backward()
        self.check_close(found, vertices.grad, 1e-3)

    def test_any_number_of_channels(self):
        samples = RENDERER.rasterize(*self.arguments())
        values = random(*samples.face_id.shape, 7, seed=1)
        images = samples.resolve(values)
        self.assertEqual(images.shape, (2, SIZE, SIZE, 7))
        for channel in range(7):
            self.assertTrue((samples.resolve(values[..., channel:channel + 1])[..., 0] == images[..., channel]).all())

    def test_what_is_refused(self):
        samples = RENDERER.rasterize(*self.arguments())
        with self.assertRaisesRegex(ValueError, r"values .*expected \[2, "):
            samples.resolve(np.zeros((2, SIZE, SIZE, 3), np.float32))
        with self.assertRaisesRegex(ValueError, "finite"):
            samples.resolve(np.full((*samples.face_id.shape, 1), np.nan, np.float32))
        with self.assertRaisesRegex(ValueError, "noise on the pixel"):
            dpr.rasterize(*self.arguments(), width=SIZE, height=SIZE, preset="gaussian")
        with self.assertRaisesRegex(ValueError, "barycentrics"):
            samples.pullback(barycentrics=np.zeros(3, np.float32))
        with self.assertRaisesRegex(ValueError, r"attributes .*\[V, C\]"):
            samples.interpolate(np.zeros(4, np.float32))
        with self.assertRaisesRegex(ValueError, "2 meshes"):
            dpr.rasterize([TETRAHEDRON, TETRAHEDRON], [FACES, FACES], self.views, self.intrinsics, width=SIZE, height=SIZE)

    def test_a_process_ends_while_its_driver_compiles(self):
        program = ("import numpy as np, dpr\n"
                   "view = np.eye(4, dtype=np.float32)[None]; view[0, 2, 3] = -4\n"
                   "lens = np.float32([[16, 16, 8, 8]])\n"
                   "try: dpr.rasterize(view[0, :3, :3], np.array([[0, 1, 2]]), view, lens, width=16, height=16, preset='gaussian')\n"
                   "except ValueError as error: print(error)\n")
        with tempfile.TemporaryDirectory() as folder:  # no kernel has been compiled
            run = subprocess.run([sys.executable, "-c", program], env={**os.environ, "POCL_CACHE_DIR": folder},
                                 capture_output=True, text=True)
        self.assertEqual((run.returncode, run.stderr), (0, ""))
        self.assertIn("noise on the pixel", run.stdout)


if __name__ == "__main__":
    unittest.main()
