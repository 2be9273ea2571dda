"""Losses of images against targets."""
import sys
from typing import Any, Optional

import numpy as np

from . import _arrays
from ._losses import alike

Array = Any
_WHERE = "dpr.image_loss"
_RADIUS = 5  # of a window
_WINDOW = np.exp(-np.arange(-_RADIUS, _RADIUS + 1) ** 2 / (2 * 1.5**2))
_WINDOW /= _WINDOW.sum()


def _joined(parts, axis):
    kind = _arrays.module_of(parts[0])
    if kind == "torch":
        return sys.modules["torch"].cat(parts, axis)
    return (sys.modules["jax"].numpy if kind == "jax" else np).concatenate(parts, axis)


def _part(array, axis, *bounds):
    return array[(slice(None),) * axis + (slice(*bounds),)]


def _shrunk(images):
    """[N, (H + 1) / 2, (W + 1) / 2, C]: means of blocks of 2x2 pixels, at the border of those that are there."""
    for axis in (1, 2):
        first, second = _part(images, axis, 0, None, 2), _part(images, axis, 1, None, 2)
        pairs = second.shape[axis]
        images = _joined([(_part(first, axis, 0, pairs) + second) / 2, _part(first, axis, pairs, None)], axis)
    return images


def _blurred(images):
    """Means by the window's weights about every pixel whose window lies in the image whole."""
    for axis in (1, 2):
        count = images.shape[axis] - 2 * _RADIUS
        images = sum(float(weight) * _part(images, axis, tap, tap + count) for tap, weight in enumerate(_WINDOW))
    return images


def _similarity(image, target):
    """[N, H - 10, W - 10, 3] of colours about their middle, where variances lose the fewest digits."""
    x, y = image - 0.5, target - 0.5
    mean_x, mean_y = _blurred(x), _blurred(y)
    variances = _blurred(x * x) + _blurred(y * y) - mean_x * mean_x - mean_y * mean_y
    covariance = _blurred(x * y) - mean_x * mean_y
    mean_x, mean_y = mean_x + 0.5, mean_y + 0.5
    return ((2 * mean_x * mean_y + 1e-4) * (2 * covariance + 9e-4) /
            ((mean_x * mean_x + mean_y * mean_y + 1e-4) * (variances + 9e-4)))


def _mean(values, mask):
    """[N] means over pixels [N, H, W, 1] by the mask, and over colour channels."""
    return (values * mask).sum((1, 2, 3)) / (3 * mask.sum((1, 2, 3)))


def _of_level(image, target, mask, weights, robust_scale):
    """[N] weighted sums of losses."""
    total = 0
    color, wanted = image[..., :3], target[..., :3]
    difference = color - wanted
    if weights["mse"]:
        total = total + weights["mse"] * _mean(difference * difference, mask)
    if weights["l1"]:
        total = total + weights["l1"] * _mean(abs(difference), mask)
    if weights["robust"]:
        squared = (difference * difference).sum(-1)[..., None]
        total = total + weights["robust"] * _mean(squared / (1 + squared / robust_scale**2), mask)
    if weights["silhouette"]:
        a, t = image[..., 3:], target[..., 3:]
        both, either = (a * t * mask).sum((1, 2, 3)), ((a + t - a * t) * mask).sum((1, 2, 3))
        are_empty = either == 0  # they agree
        total = total + weights["silhouette"] * (1 - (both + are_empty) / (either + are_empty))
    if weights["ssim"]:
        middle = mask[:, _RADIUS:-_RADIUS, _RADIUS:-_RADIUS]
        total = total + weights["ssim"] * (1 - _mean(_similarity(color, wanted), middle))
    return total


def _images(name, array, of=None):
    shape = list(array.shape)
    is_right = len(shape) in (3, 4) and (shape[-1] == 1 if name == "mask" else shape[-1] in (3, 4)) and all(shape)
    if is_right and of is not None:
        is_right = shape[-3:-1] == list(of.shape[-3:-1]) and (len(shape) == 3 or shape[0] in (1, of.shape[0]))
    if not is_right:
        size = "H, W" if of is None else f"{of.shape[1]}, {of.shape[2]}"
        channels = "1" if name == "mask" else "3 or 4"
        _arrays.fail(ValueError, name, shape, f"[{size}, {channels}], or that of each view", _WHERE)
    return array if len(shape) == 4 else array[None]


def image_loss(image: Array, target: Array, *, mse: float = 0, l1: float = 0, silhouette: float = 0, robust: float = 0,
               ssim: float = 0, robust_scale: float = 0.1, mask: Optional[Array] = None, levels: int = 1) -> Array:
    """Weighted sum of losses between images and targets, the mean over views: dpr::ImageLoss (dpr/image_loss.hpp) for
    arrays, on whatever device they are. One number; of PyTorch's tensors and JAX's arrays a function with derivatives.

    image, target  [H, W, C] or [N, H, W, C] of linear colours: RGB, or RGBA, which a silhouette needs. One target may
                   stand for all views
    mse, l1        weights of the mean squared and the mean absolute difference of colours
    silhouette     of 1 - intersection over union of alpha, eq. (75)
    robust         of mse in which pixels of quite another colour hardly count: s / (1 + s / robust_scale^2), with s a
                   pixel's squared difference (Geman & McClure 1985)
    ssim           of 1 - structural similarity (Wang et al. 2004): windows of 11x11 pixels, Gaussian of 1.5 pixels
    mask           [H, W, 1] or [N, H, W, 1], at least 0: how much a pixel counts; a window as the pixel at its middle
    levels         of a pyramid, of whose losses the result is the mean: large differences of place get gradients

    Raises ValueError for other shapes, negative weights or none above 0, and a mask of zeros, but not while JAX traces;
    TypeError for what is no array.
    """
    weights = {"mse": mse, "l1": l1, "silhouette": silhouette, "robust": robust, "ssim": ssim}
    for name, weight in weights.items():
        if not 0 <= weight < np.inf:
            _arrays.fail(ValueError, name, weight, "a finite weight, at least 0", _WHERE)
    if not any(weights.values()):
        _arrays.fail(ValueError, "weights", "none above 0", f"one of {', '.join(weights)}", _WHERE)
    if not robust_scale >= 1e-6:
        _arrays.fail(ValueError, "robust_scale", robust_scale, "a colour difference, at least 1e-6", _WHERE)
    if levels not in range(1, 17):
        _arrays.fail(ValueError, "levels", levels, "1 to 16", _WHERE)
    given = {name: _arrays.converted(name, _arrays.from_numbers(array), where=_WHERE)
             for name, array in (("image", image), ("target", target), ("mask", mask)) if array is not None or name != "mask"}
    given = dict(zip(given, alike(given, _WHERE)))
    image = _images("image", given["image"])
    target = _images("target", given["target"], image)
    if silhouette and not image.shape[-1] == target.shape[-1] == 4:
        _arrays.fail(ValueError, "silhouette", "images without alpha", "RGBA", _WHERE)
    mask = image[..., :1] * 0 + 1 if mask is None else _images("mask", given["mask"], image)
    total = 0
    for level in range(levels):
        if level:
            image, target, mask = _shrunk(image), _shrunk(target), _shrunk(mask)
        if ssim and min(image.shape[1:3]) <= 2 * _RADIUS:
            _arrays.fail(ValueError, "ssim", f"{image.shape[2]}x{image.shape[1]} pixels",
                         "11x11 or more on every level, a window's", _WHERE)
        counted = mask[:, _RADIUS:-_RADIUS, _RADIUS:-_RADIUS] if ssim else mask
        if _arrays.module_of(mask) != "jax" and not (mask.min() >= 0 and (counted.sum((1, 2, 3)) > 0).all()):
            _arrays.fail(ValueError, "mask", "negative or all 0", "at least 0, above 0 somewhere in each view", _WHERE)
        total = total + _of_level(image, target, mask, weights, robust_scale)
    return total.mean() / levels
