"""Cameras of other descriptions as a call takes them: views [N, 4, 4] and intrinsics [N, 4], N = 1 for one camera.

Arrays of NumPy, PyTorch and JAX come back as the same, functions with derivatives of those given; lists and numbers come
back as NumPy's, float32. Pixels count from the corner of the top-left pixel.

    views = dpr.look_at([0, 1, 4])
    image = dpr.render(vertices, faces, views, dpr.perspective(60, 64, 64), width=64, height=64)
    views, intrinsics = dpr.cameras.from_opencv(R, t, K)
"""
from __future__ import annotations

import sys
from typing import Any, Optional, Tuple

import numpy as np

from . import _arrays

Array = Any
"""Array of NumPy, PyTorch or JAX, or nested lists of numbers."""
_LEAST_SINE = 1e-6


def _fail(name, got, expected):
    _arrays.fail(ValueError, name, got, expected, "dpr.cameras")


def _numbers(value):
    try:
        return np.asarray(value, np.float32)
    except (TypeError, ValueError):
        _arrays.fail(TypeError, "argument", repr(value), "an array, or nested lists of numbers", "dpr.cameras")


def _together(*values):
    """(module with functions of arrays, the values as its arrays of one type)"""
    homes = {_arrays.module_of(value): value for value in reversed(values) if _arrays.is_array(value)}
    if "torch" in homes or _arrays.is_compiling():
        torch, home = sys.modules["torch"], homes.get("torch")
        home_type = home.dtype if home is not None and home.is_floating_point() else torch.float32
        return torch, [torch.as_tensor(value, dtype=home_type, device=None if home is None else home.device)
                       for value in values]
    if "jax" in homes:
        return sys.modules["jax"].numpy, [sys.modules["jax"].numpy.asarray(value, np.float32) for value in values]
    arrays = [_arrays.to_numpy(value) if _arrays.is_array(value) else _numbers(value) for value in values]
    home_type = next((array.dtype for array in arrays if array.dtype == np.float64), np.float32)
    return np, [array.astype(home_type) for array in arrays]


def _batch(name, array, *shape):
    """[N, *shape] of an array that may lack the first dimension."""
    if tuple(array.shape) == shape:
        return array[None]
    if array.ndim != len(shape) + 1 or tuple(array.shape[1:]) != shape:
        _fail(name, list(array.shape), f"{list(shape)} or [N, " + str(list(shape))[1:] if shape else "a number or [N]")
    return array


def _require_size(width, height):
    for name, size in (("width", width), ("height", height)):
        if not 0 < size < np.inf:
            _fail(name, size, "pixels, above 0")


def _columns(lib, *columns):
    """Arrays [N] or [N, ...] side by side, each also of N = 1."""
    broadcast = lib.broadcast_arrays if hasattr(lib, "broadcast_arrays") else lib.broadcast_tensors
    return lib.stack(list(broadcast(*columns)), -1)


def _affine(lib, linear, translation):
    """[N, 4, 4] of [N, 3, 3] and [N, 3], either also of N = 1."""
    top = _columns(lib, linear[..., 0], linear[..., 1], linear[..., 2], translation)
    last = lib.broadcast_to(_together(top, [[[0, 0, 0, 1]]])[1][1], (top.shape[0], 1, 4))
    return (lib.cat if hasattr(lib, "cat") else lib.concatenate)([top, last], 1)


def _cross(lib, a, b):
    return _columns(lib, *(a[:, i - 2] * b[:, i - 1] - a[:, i - 1] * b[:, i - 2] for i in range(3)))


def _unit(lib, vectors, name, least=0.0):
    lengths = lib.sqrt((vectors * vectors).sum(-1))
    known = _arrays.known(lengths)
    if known is not None and not (known > least).all():
        _fail(name, "directions without length", "eye and target apart, and up not along the view")
    return vectors / lengths[:, None]


def _axes(lib, eye, target, up):
    """(right, up, back) of cameras, unit vectors [N, 3]."""
    back = _unit(lib, eye - target, "eye")
    right = _unit(lib, _cross(lib, _unit(lib, up, "up"), back), "up", _LEAST_SINE)
    return right, _cross(lib, back, right), back


def _points(names, arrays):
    """[N, 3] or [1, 3] of each."""
    arrays = [_batch(name, array, 3) for name, array in zip(names, arrays)]
    count = max(array.shape[0] for array in arrays)
    for name, array in zip(names, arrays):
        known = _arrays.known(array)
        if array.shape[0] not in (1, count):
            _fail(name, list(array.shape), f"[3], [1, 3] or [{count}, 3], as {' and '.join(names)} go together")
        if known is not None and not np.isfinite(known).all():
            _fail(name, "infinity or NaN", "finite numbers")
    return arrays


def look_at(eye: Array, target: Array = (0, 0, 0), up: Array = (0, 1, 0)) -> Array:
    """Views [N, 4, 4] of cameras at `eye` that look at `target`: points [3] or [N, 3] in world space. `up` is a
    direction, upwards in the image. Raises ValueError where eye and target are one, and where up is along the view."""
    lib, arrays = _together(eye, target, up)
    eye, target, up = _points(("eye", "target", "up"), arrays)
    axes = _axes(lib, eye, target, up)
    rows = lib.stack(list(axes), 1)
    return _affine(lib, rows, -(rows * eye[:, None]).sum(-1))


def perspective(fov_y_degrees: Array, width: int, height: int) -> Array:
    """Intrinsics [N, 4] of a field of view from the lower to the upper edge, a number or [N]; the axis is in the middle.
    Raises ValueError for an angle that is not between 0 and 180 degrees."""
    _require_size(width, height)
    lib, (fov,) = _together(fov_y_degrees)
    known = _arrays.known(fov)
    if known is not None and not ((known > 0) & (known < 180)).all():
        _fail("fov_y_degrees", np.asarray(known).tolist(), "degrees, above 0 and below 180")
    return _intrinsics(lib, (height / 2) / lib.tan(_batch("fov_y_degrees", fov) * (np.pi / 360)), width, height)


def _intrinsics(lib, focal, width, height):
    """Of a focal length in pixels, [N]."""
    return _columns(lib, focal, focal, 0 * focal + width / 2, 0 * focal + height / 2)


def from_opengl(projection: Array, width: int, height: int) -> Array:
    """Intrinsics of matrices to clip space, [4, 4] or [N, 4, 4], as OpenGL and nvdiffrast have them; views are their
    modelview matrices as they are.

    projection[1, 1] > 0: images have the upper row first, and nvdiffrast's the lower one: image.flip(1) compares. With
    projection[1, 1] < 0, as in nvdiffrast's samples, both have the rows in one order. [N, 1] of orthographic matrices,
    which must not be off centre. znear and zfar are settings. Raises ValueError for another kind of matrix."""
    _require_size(width, height)
    lib, (projection,) = _together(projection)
    matrix = _batch("projection", projection, 4, 4)
    known = _arrays.known(matrix)
    is_orthographic = known is not None and bool((known[:, 3] == [0, 0, 0, 1]).all())
    if known is not None:
        _require_projection(known, is_orthographic, width, height)
    if is_orthographic:
        return 2 / abs(matrix[:, 1, 1, None])
    upwards = matrix[:, 1, 1] / abs(matrix[:, 1, 1])
    return _columns(lib, matrix[:, 0, 0] * (width / 2), abs(matrix[:, 1, 1]) * (height / 2),
                    (1 - matrix[:, 0, 2]) * (width / 2), (1 + upwards * matrix[:, 1, 2]) * (height / 2))


def _require_projection(matrix, is_orthographic, width, height):
    if not is_orthographic and not np.allclose(matrix[:, 3], [0, 0, -1, 0]):
        _fail("projection", f"a last row {matrix[0, 3].tolist()}", "[0, 0, -1, 0], or [0, 0, 0, 1], orthographic")
    if np.any(matrix[:, [0, 1], [1, 0]]) or np.any(matrix[:, :2, 2 if is_orthographic else 3]):
        _fail("projection", matrix[0].tolist(), "one without skew")
    if is_orthographic and not (np.allclose(matrix[:, :2, 3], 0, atol=1e-6)
                                and np.allclose(matrix[:, 0, 0] * width, abs(matrix[:, 1, 1]) * height)):
        _fail("projection", matrix[0].tolist(), "an orthographic one on the image's centre, with square pixels")


def from_opencv(rotation: Array, translation: Array, matrix: Array, distortion: Optional[Array] = None, *,
                fisheye: Optional[Array] = None) -> Tuple[Array, Array]:
    """(views, intrinsics) of OpenCV's cameras: x_camera = rotation x + translation with y down and z forward, [3, 3] or
    [N, 3, 3] and [3] or [N, 3]; the camera matrix [3, 3] or [N, 3, 3], which counts from a pixel's centre.

    distortion: 4 or 5 coefficients of a lens, k1, k2, p1, p2, k3, also [N, 4] or [N, 5]; or fisheye: the 4 coefficients D
    of cv2.fisheye, also [N, 4]. Raises ValueError for both of them, and for a skewed camera matrix."""
    if distortion is not None and fisheye is not None:
        _fail("fisheye", "distortion and fisheye", "one of them")
    name, lens, counts = ("distortion", distortion, (4, 5)) if fisheye is None else ("fisheye", fisheye, (4,))
    if lens is None:
        lib, (rotation, translation, matrix) = _together(rotation, translation, matrix)
    else:
        lib, (rotation, translation, matrix, lens) = _together(rotation, translation, matrix, lens)
    rotation, matrix = _batch("rotation", rotation, 3, 3), _batch("matrix", matrix, 3, 3)
    if translation.ndim > 1 and translation.shape[-1] == 1:  # a column, as OpenCV has it
        translation = translation[..., 0]
    translation, known = _batch("translation", translation, 3), _arrays.known(matrix)
    if known is not None and np.any(known[:, 0, 1]):
        _fail("matrix", f"a skew of {known[0, 0, 1]}", "0")
    signs = _together(rotation, [1, -1, -1])[1][1]
    views = _affine(lib, signs[:, None] * rotation, signs * translation)
    columns = [matrix[:, 0, 0], matrix[:, 1, 1], matrix[:, 0, 2] + 0.5, matrix[:, 1, 2] + 0.5]
    if lens is not None:
        if lens.ndim == 2 and lens.shape[1] == 1:  # a column, as OpenCV has it
            lens = lens[:, 0]
        count = lens.shape[-1] if lens.ndim else 0
        if count not in counts:
            _fail(name, list(lens.shape), " or ".join(map(str, counts)) + " coefficients")
        lens = _batch(name, lens, count)
        columns += [lens[:, i] for i in range(count)] + [0 * lens[:, 0]] * (counts[-1] - count)
    return views, _columns(lib, *columns)


def from_pytorch3d(R: Array, T: Array, width: int, height: int, *, fov_degrees: Optional[Array] = None,
                   focal_length: Optional[Array] = None, principal_point: Optional[Array] = None,
                   in_ndc: bool = True) -> Tuple[Array, Array]:
    """(views, intrinsics) of PyTorch3D's cameras: x_camera = x R + T of row vectors, with x to the left, y up, z forward.

    R [3, 3] or [N, 3, 3], T [3] or [N, 3]. Either fov_degrees, of FoVPerspectiveCameras, a number or [N]; or, of
    PerspectiveCameras, focal_length, a number, [N] or [N, 2], and principal_point [N, 2]: in NDC, where half the short
    side of the image is 1 and x is to the left, or pixels with in_ndc=False. Raises ValueError without exactly one of
    fov_degrees and focal_length."""
    if (fov_degrees is None) == (focal_length is None):
        _fail("fov_degrees", "both or none of fov_degrees and focal_length", "one of them")
    _require_size(width, height)
    lib, (R, T, focal) = _together(R, T, focal_length if fov_degrees is None else fov_degrees)
    R, T = _batch("R", R, 3, 3), _batch("T", T, 3)
    signs = _together(R, [-1, 1, -1])[1][1]
    views = _affine(lib, signs[:, None] * lib.swapaxes(R, 1, 2), signs * T)
    half = min(width, height) / 2 if in_ndc or fov_degrees is not None else 1
    if fov_degrees is not None:
        focal = 1 / lib.tan(focal * (np.pi / 360))
    focal = focal * half if focal.ndim == 2 else _batch("focal_length", focal)[:, None] * half
    center = _together(R, [width / 2, height / 2])[1][1][None]
    if principal_point is not None:
        point = _batch("principal_point", _together(R, principal_point)[1][1], 2)
        center = center - half * point if in_ndc else point
    return views, _columns(lib, focal[:, 0], focal[:, -1], center[:, 0], center[:, 1])


def from_softras(eye: Array, size: int, *, viewing_angle: Array = 30, at: Array = (0, 0, 0),
                 up: Array = (0, 1, 0)) -> Tuple[Array, Array]:
    """(views, intrinsics) of SoftRas' and Neural Mesh Renderer's "look_at" cameras: eye, at and up as look_at() has them,
    and images of size x size; viewing_angle, in degrees, is half the field of view.

    Their images are mirror images, x to the left, and so are those of these views, whose determinants are -1. With
    lights, normals that point away from the camera are lit otherwise than in a view without a mirror."""
    if not 0 < size < np.inf:
        _fail("size", size, "pixels, above 0")
    lib, (*arrays, angle) = _together(eye, at, up, viewing_angle)
    eye, at, up = _points(("eye", "at", "up"), arrays)
    right, upwards, back = _axes(lib, eye, at, up)
    rows = lib.stack([-right, upwards, back], 1)
    focal = (size / 2) / lib.tan(_batch("viewing_angle", angle) * (np.pi / 180))
    return _affine(lib, rows, -(rows * eye[:, None]).sum(-1)), _intrinsics(lib, focal, size, size)
