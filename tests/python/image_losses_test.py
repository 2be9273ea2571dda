"""Losses of images in the Python package `dpr`."""
import json
import os
import pathlib
import subprocess
import tempfile
import unittest

import numpy as np

try:
    import torch
except ImportError:
    torch = None

import dpr

KINDS = ("mse", "l1", "silhouette", "robust", "ssim")


def images(views=2, height=15, width=18, channels=4, seed=0):
    random = np.random.default_rng(seed)
    return [random.random((views, height, width, channels)).astype(np.float32) for _ in range(2)]


def similarity(x, y):
    """Of the windows of one channel, as Wang et al. write it."""
    taps = np.exp(-np.arange(-5, 6) ** 2 / 4.5)
    weights = np.outer(taps, taps) / taps.sum() ** 2
    found = []
    for row in range(x.shape[0] - 10):
        for column in range(x.shape[1] - 10):
            a, b = x[row:row + 11, column:column + 11], y[row:row + 11, column:column + 11]
            mean_a, mean_b = (weights * a).sum(), (weights * b).sum()
            covariance = (weights * (a - mean_a) * (b - mean_b)).sum()
            variances = (weights * (a - mean_a) ** 2).sum() + (weights * (b - mean_b) ** 2).sum()
            found.append((2 * mean_a * mean_b + 1e-4) * (2 * covariance + 9e-4) /
                         ((mean_a**2 + mean_b**2 + 1e-4) * (variances + 9e-4)))
    return np.mean(found)


class ImageLossTest(unittest.TestCase):
    def test_definitions(self):
        image, target = images()
        x, y = image.astype(float), target.astype(float)
        squared, alphas = ((x - y)[..., :3] ** 2).sum(-1), (x[..., 3], y[..., 3])
        both = (alphas[0] * alphas[1]).sum((1, 2))
        wanted = {"mse": squared.mean() / 3, "l1": abs(x - y)[..., :3].mean(),
                  "silhouette": np.mean(1 - both / ((alphas[0] + alphas[1]).sum((1, 2)) - both)),
                  "robust": np.mean(squared / (1 + squared / 0.3**2)) / 3,
                  "ssim": 1 - np.mean([similarity(x[v, ..., c], y[v, ..., c]) for v in range(2) for c in range(3)])}
        for kind, value in wanted.items():
            found = dpr.image_loss(image, target, **{kind: 2}, robust_scale=0.3)
            self.assertAlmostEqual(float(found), 2 * value, 5, kind)
        together = dpr.image_loss(image.tolist(), target, **dict.fromkeys(KINDS, 0.5), robust_scale=0.3)
        self.assertAlmostEqual(float(together), sum(wanted.values()) / 2, 5)

    def test_equal_and_empty_images(self):
        image, _ = images()
        image[..., 3] = image[..., 3].round()
        for kind in KINDS:
            self.assertAlmostEqual(float(dpr.image_loss(image, image, **{kind: 1})), 0, delta=1e-6, msg=kind)
        self.assertEqual(dpr.image_loss(0 * image, 0 * image, silhouette=1), 0)

    def test_masks_and_levels(self):
        """What a mask leaves out has no part; a level is the loss of images made smaller beforehand."""
        image, target = images(height=25, width=31)
        mask = np.zeros((25, 31, 1), np.float32)
        mask[:, :20] = 1
        other = image.copy()
        other[:, :, 20:] = 0
        for kind in ("mse", "l1", "silhouette", "robust"):
            of_mask, of_other, of_part = (float(dpr.image_loss(a, b, mask=m, **{kind: 1})) for a, b, m in (
                (image, target, mask), (other, target, mask), (image[:, :, :20], target[:, :, :20], None)))
            self.assertEqual(of_mask, of_other, kind)
            self.assertAlmostEqual(of_mask, of_part, 6, kind)
        self.assertAlmostEqual(float(dpr.image_loss(image, target, mask=mask, ssim=1)),
                               float(dpr.image_loss(image[:, :, :25], target[:, :, :25], ssim=1)), 5)

        def small(images):
            whole = np.pad(images, ((0, 0), (0, 1), (0, 1), (0, 0)), constant_values=np.nan)
            return np.nanmean(whole.reshape(2, 13, 2, 16, 2, 4), (2, 4))

        for kind in KINDS:
            parts = [float(dpr.image_loss(*pair, **{kind: 1})) for pair in (
                (image, target), (small(image), small(target)))]
            self.assertAlmostEqual(float(dpr.image_loss(image, target, levels=2, **{kind: 1})), sum(parts) / 2, 5, kind)

    @unittest.skipUnless(torch, "no PyTorch")
    def test_gradients(self):
        image, target = (torch.from_numpy(array).double() for array in images(1, 12, 13, 4, 5))
        mask = torch.rand(12, 13, 1, dtype=torch.float64)
        image.requires_grad_()
        for kind in KINDS:
            loss = dpr.image_loss(image, target.numpy(), mask=mask, **{kind: 1})
            self.assertEqual((loss.shape, loss.dtype), ((), torch.float32))
            gradient, = torch.autograd.grad(loss, image)
            direction = torch.randn(image.shape, generator=torch.Generator().manual_seed(1), dtype=torch.float64)
            step = 1e-3
            ends = [dpr.image_loss((image + sign * step * direction).detach(), target, mask=mask, **{kind: 1})
                    for sign in (-1, 1)]
            expected = float(ends[1] - ends[0]) / (2 * step)
            self.assertAlmostEqual(float((gradient * direction).sum()), expected, delta=2e-3 * max(abs(expected), 0.05))
            swapped = dpr.image_loss(target.numpy(), image, mask=mask, **{kind: 1})
            if kind != "silhouette":
                self.assertAlmostEqual(float(swapped.detach()), float(loss.detach()), 5)
            self.assertGreater(float(torch.autograd.grad(swapped, image)[0].abs().max()), 0)
        empty = torch.zeros(1, 12, 13, 4, requires_grad=True)
        dpr.image_loss(empty, torch.zeros_like(empty), **dict.fromkeys(KINDS, 1)).backward()
        self.assertTrue(empty.grad.isfinite().all())

    @unittest.skipUnless(os.environ.get("DPR_CLI"), "no command")
    def test_agrees_with_the_library(self):
        data = pathlib.Path(__file__).resolve().parents[2] / "bench/data"
        with tempfile.TemporaryDirectory() as name:
            folder = pathlib.Path(name)

            def run(*arguments):
                subprocess.run([os.environ["DPR_CLI"], *map(str, arguments)], check=True, capture_output=True)

            scene = folder / "scene.json"
            run("render", data / "spot_low.obj", "-o", folder / "target.exr", "--size", "48x40", "--azimuth", "215",
                "--save-scene", scene)
            run("render", "--scene", scene, "-o", folder / "image.exr", "--preset", "pixel", "--sigma", "3e-2")
            image, target = (dpr.read_image(folder / file) for file in ("image.exr", "target.exr"))
            for kind in KINDS:
                run("gradient", "--scene", scene, "--target", folder / "target.exr", "--preset", "pixel", "--sigma",
                    "3e-2", "--loss", kind, "-o", folder / "gradient.json")
                loss = json.loads((folder / "gradient.json").read_text())["loss"]
                self.assertGreater(loss, 1e-4)
                found = float(dpr.image_loss(image, target, **{kind: 1}))
                self.assertAlmostEqual(found, loss, delta=1e-4 * loss + 1e-7, msg=kind)

    def test_errors(self):
        image, target = images()
        for arguments, message in (
                ((image, target), "weights .*none above 0"), ((image, target, {"mse": -1}), "mse .*-1"),
                ((image, target[:, 1:], {"mse": 1}), r"target .*15, 18, 3 or 4"),
                ((image[0, 0], target, {"mse": 1}), "image .*H, W"),
                ((image, target, {"mse": 1, "levels": 0}), "levels"),
                ((image[..., :3], target, {"silhouette": 1}), "silhouette .*RGBA"),
                ((image[:, :9], target[:, :9], {"ssim": 1}), "ssim .*18x9"),
                ((image, target, {"ssim": 1, "levels": 2}), "ssim .*9x8"),
                ((image, target, {"mse": 1, "mask": 0 * image[0, ..., :1]}), "mask .*all 0"),
                ((image, target, {"mse": 1, "mask": image[0]}), "mask"),
                ((image, target, {"robust": 1, "robust_scale": 0}), "robust_scale")):
            *arrays, options = arguments if isinstance(arguments[-1], dict) else (*arguments, {})
            with self.subTest(message=message), self.assertRaisesRegex(ValueError, message):
                dpr.image_loss(*arrays, **options)
        with self.assertRaisesRegex(TypeError, "target"):
            dpr.image_loss(image, "target.png", mse=1)


if __name__ == "__main__":
    unittest.main()
