"""Clip-space positions (x, y, z, w) of OpenGL as vertices in front of the library's cameras."""
import dataclasses

import torch

from . import _arrays

_FLAT, _ROUNDING, _LEAST_NEAR = 1e-4, 1e-4, 1e-6


@dataclasses.dataclass(frozen=True)
class Camera:
    """Camera of all shapes in a call. Its images have row 0 at the bottom.

    is_perspective  True: depth is w times scale. False: depth is z / w + 2, and the camera is orthographic
    scale           [N, 1, 1], factors of positions; the same factor for x, y, z and w changes no image
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
    """(a, b, is_affine) of each row's least-squares fit z = a w + b; is_affine: the fit is exact but for rounding."""
    mean_w, mean_z = w.mean(1, keepdim=True), z.mean(1, keepdim=True)
    spread = (w - mean_w).square().sum(1, keepdim=True).clamp(min=1e-300)
    a = ((w - mean_w) * (z - mean_z)).sum(1, keepdim=True) / spread
    b = mean_z - a * mean_w
    largest = z.abs().amax(1, keepdim=True) + w.abs().amax(1, keepdim=True)
    return a, b, ((z - a * w - b).abs() <= _ROUNDING * largest).all(1, keepdim=True)


def camera_of(pos, used, where):
    """Camera of positions [N, V, 4]. used [V]: vertices that triangles use.

    A projection matrix makes z = a w + b. Then w serves as depth: it is more precise than z / w, and triangles may
    reach behind the camera. The near plane z = -w is the plane w = -b / (a + 1), and z / w grows with w unless b is
    positive. Otherwise z / w serves as depth, which needs all positions in front of the camera."""
    z, w = pos.detach()[:, used, 2:].double().unbind(-1)
    if not z.shape[1]:
        return Camera(False, pos.new_ones(1, 1, 1), 1.0, 3.5)
    least, most = w.amin(1, keepdim=True), w.amax(1, keepdim=True)
    a, b, is_affine = _fit(z, w)
    near = torch.where(a > -1, -b / (a + 1).clamp(min=1e-30), torch.zeros_like(b))
    near = torch.maximum(near, _LEAST_NEAR * most.abs())
    is_clipped = least < near
    scale = 1 / torch.where(is_clipped, near, least).clamp(min=1e-30)
    # Drop of z / w from the nearest to the furthest vertex. Positive: z / w orders depths the other way round.
    fall = b * (scale - 1 / most)
    is_flat = most - least <= _FLAT * most.abs()
    if bool(((is_affine & (fall <= _ROUNDING) & ~is_flat) | (most <= 0)).all()):
        znear, furthest = 1.0 if bool(is_clipped.any()) else 0.999, float((scale * most).max())
        return Camera(True, scale[..., None].to(pos.dtype), znear, max(1.01 * furthest, 2.0))
    if bool((least > _LEAST_NEAR * most.abs()).all()):
        return Camera(False, pos.new_ones(1, 1, 1), 1.0, 3.5)
    _arrays.fail(ValueError, "pos", "positions behind the camera (w <= 0) whose z is no affine function of w that "
                 "orders depths", "positions of one projection matrix a shape, or all in front of the camera", where)
