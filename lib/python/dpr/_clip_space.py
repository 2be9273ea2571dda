"""Clip-space positions (x, y, z, w) of OpenGL as vertices in front of the library's cameras."""
import ctypes
import dataclasses

import numpy as np
import torch

from . import _frames, _library


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


def camera_of(pos, faces, size, where):
    """Camera of positions [N, V, 4] as ClipSpace of the library finds it. faces [F, 3]: triangles of each shape; None: all
    vertices count. size: (height, width)"""
    given = [("positions", pos.detach().contiguous().numpy())]
    if faces is not None:
        if not len(faces):
            return Camera(False, pos.new_ones(1, 1, 1), 1.0, 3.5)
        given.append(("faces", faces.detach().contiguous().numpy()))
    handle, shapes, intrinsics = ctypes.c_void_p(), ctypes.c_size_t(), ctypes.c_size_t()
    try:
        _library.call("dpr_clip_space_create", size[1], size[0], *_frames.c_arrays(given), ctypes.byref(handle))
    except _library.InvalidArgument as error:
        raise _library.InvalidArgument(str(error).replace("positions", "pos", 1).replace("ClipSpace", where)) from None
    scales, planes = np.empty(len(pos), np.float32), np.empty(2, np.float32)
    try:
        _library.call("dpr_clip_space_size", handle, ctypes.byref(shapes), ctypes.byref(intrinsics))
        _library.call("dpr_clip_space_read", handle, *_frames.c_arrays([("scales", scales), ("planes", planes)]))
    finally:
        _library.library.dpr_clip_space_destroy(handle)
    scale = torch.from_numpy(scales)[:, None, None].to(pos.dtype)
    return Camera(intrinsics.value == 4, scale, *map(float, planes))
