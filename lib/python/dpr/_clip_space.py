"""Clip-space positions (x, y, z, w) of OpenGL as vertices in front of the library's cameras."""
import dataclasses

import torch

from . import _arrays

_FLAT, _ROUNDING, _LEAST_NEAR = 1e-4, 1e-4, 1e-6


@dataclasses.dataclass(frozen=True)
class Camera:
    """Camera of all shapes of a call. Its images have row 0 at the bottom.

    is_perspective  whether depth is w, in units of 1 / scale, or z / w + 2 as an orthographic camera sees it
    scale           [N, 1, 1], factors of positions: scaling x, y, z and w together changes no image
    """

    is_perspective: bool
    scale: torch.Tensor
    znear: float
    zfar: float

    def vertices(self, pos, used, width, height):
        """[N, V, 3] of positions [N, V, 4]; a differentiable function."""
        if self.is_perspective:
            return (pos[..., (0, 1, 3)] * (self.scale * pos.new_tensor([1, 1, -1]))).contiguous()
        w = torch.where(used, pos[..., 3], pos.new_ones(()))[..., None]
        places = torch.where(used[..., None], pos[..., :3], pos.new_zeros(())) / w
        return (places * places.new_tensor([width / height, 1, -1]) - places.new_tensor([0, 0, 2])).contiguous()

    def views_and_intrinsics(self, count, width, height):
        views = torch.diag(torch.tensor([1.0, -1.0, 1.0, 1.0])).repeat(count, 1, 1)
        lens = [width / 2, height / 2, width / 2, height / 2] if self.is_perspective else [2.0]
        return views, torch.tensor([lens]).repeat(count, 1)


def _fit(z, w):
    """(a, b) of z = a w + b per row, and whether every z is that but for rounding. A row of equal w has no such a."""
    mean_w, mean_z = w.mean(1, keepdim=True), z.mean(1, keepdim=True)
    a = ((w - mean_w) * (z - mean_z)).sum(1, keepdim=True) / (w - mean_w).square().sum(1, keepdim=True).clamp(min=1e-300)
    b = mean_z - a * mean_w
    largest = z.abs().amax(1, keepdim=True) + w.abs().amax(1, keepdim=True)
    return a, b, ((z - a * w - b).abs() <= _ROUNDING * largest).all(1, keepdim=True)


def camera_of(pos, used, where):
    """Camera of positions [N, V, 4], of which `used` [V] says what triangles use.

    A projection matrix has z = a w + b. Then depth is w, more exact than z / w, and triangles may pass through the
    camera: the near plane z = -w is w = -b / (a + 1), and the smallest z / w is the smallest w where b is not positive.
    Without such a matrix depth is z / w, of positions in front of the camera."""
    z, w = pos.detach()[:, used, 2:].double().unbind(-1)
    if not z.shape[1]:
        return Camera(False, pos.new_ones(1, 1, 1), 1.0, 3.5)
    least, most = w.amin(1, keepdim=True), w.amax(1, keepdim=True)
    a, b, is_affine = _fit(z, w)
    near = torch.where(a > -1, -b / (a + 1).clamp(min=1e-30), torch.zeros_like(b))
    near = torch.maximum(near, _LEAST_NEAR * most.abs())
    is_clipped = least < near
    scale = 1 / torch.where(is_clipped, near, least)
    # How far z / w falls where w grows: not at all in the order of depths of a projection.
    fall = b * (scale - 1 / most)
    is_flat = most - least <= _FLAT * most.abs()
    if bool(((is_affine & (fall <= _ROUNDING) & ~is_flat) | (most <= 0)).all()):
        furthest = float((scale * most).max())
        return Camera(True, scale[..., None].to(pos.dtype), 1.0 if bool(is_clipped.any()) else 0.999, max(1.01 * furthest, 2.0))
    if bool((least > _LEAST_NEAR * most.abs()).all()):
        return Camera(False, pos.new_ones(1, 1, 1), 1.0, 3.5)
    _arrays.fail(ValueError, "pos", "positions behind the camera (w <= 0) whose z is no affine function of w that orders "
                 "depths", "positions of one projection matrix a shape, or all in front of the camera", where)
