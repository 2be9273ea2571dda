"""The operations of nvdiffrast 0.4's module nvdiffrast.torch on CPU tensors. A script imports this module instead.

    import dpr.nvdiffrast as dr

    rast, rast_db = dr.rasterize(dr.RasterizeCudaContext(), pos, tri, resolution=[256, 256])
    color, _ = dr.interpolate(attr, rast, tri)
    image = dr.antialias(color, rast, pos, tri)

Names, arguments, shapes and conventions are nvdiffrast's: positions are in OpenGL's clip space, row 0 of an image is
at the bottom, u and v are the weights of a triangle's corners 0 and 1. Tensors are float32, triangles int32 or int64.

Differences: antialias() is the library's own, Samples.resolve() without a blur, so blended pixels have slightly other
colours, and gradients of positions are those of the library. DepthPeeler rasterizes anew for every layer.
"""
from __future__ import annotations

import numbers
from typing import Any, List, Optional, Sequence, Tuple, Union

import torch
from torch import Tensor

from . import _arrays, _library, _rasterized, _torch
from ._clip_frames import Frames
from ._texture import Mip, check_floats, texture, texture_construct_mip

__all__ = ["DepthPeeler", "RasterizeCudaContext", "RasterizeGLContext", "antialias",
           "antialias_construct_topology_hash", "get_log_level", "interpolate", "rasterize", "set_log_level", "texture",
           "texture_construct_mip"]

_MOST_FACES = 1 << 24
"""rast holds triangle numbers as float32, which is exact below this."""
_log_level = 1


def _fail(name, got, expected, call, error=ValueError):
    _arrays.fail(error, name, got, expected, "dpr.nvdiffrast." + call)


def get_log_level() -> int:
    """The level that set_log_level() stored; 1 by default."""
    return _log_level


def set_log_level(level: int) -> None:
    """Stores a level from 0 (info) to 3 (fatal). It has no effect, because this module logs nothing."""
    global _log_level
    if level not in (0, 1, 2, 3):
        _fail("level", repr(level), "0, 1, 2 or 3", "set_log_level")
    _log_level = level


class _Context:
    """First argument of rasterize(). device: an OpenCL device as dpr.Renderer takes it; a device of PyTorch selects the
    default."""

    def __init__(self, device: Any = None):
        is_torch = device is None or isinstance(device, (torch.device, int)) or str(device).startswith("cuda")
        self.device = "" if is_torch else device


class RasterizeCudaContext(_Context):
    """Handle for rasterize()."""


class RasterizeGLContext(_Context):
    """Handle for rasterize(), which returns an empty rast_db with output_db=False. No context needs activating, so mode
    ("automatic" or "manual"), set_context() and release_context() have no effect."""

    def __init__(self, output_db: bool = True, mode: str = "automatic", device: Any = None):
        super().__init__(device)
        if mode not in ("automatic", "manual"):
            _fail("mode", repr(mode), "'automatic' or 'manual'", "RasterizeGLContext")
        self.output_db, self.mode = bool(output_db), mode

    def set_context(self) -> None:
        """Does nothing."""

    def release_context(self) -> None:
        """Does nothing."""


class _TopologyHash:
    """Result of antialias_construct_topology_hash()."""


def antialias_construct_topology_hash(tri: Tensor) -> _TopologyHash:
    """A placeholder for antialias(), which needs no such table: the library finds and caches edges itself."""
    _check_tri(tri, None, "antialias_construct_topology_hash")
    return _TopologyHash()


def _check_tri(tri, count, call):
    if not isinstance(tri, Tensor) or tri.dtype not in (torch.int32, torch.int64):
        got = str(getattr(tri, "dtype", type(tri).__name__))
        _fail("tri", got, "a tensor of torch.int32 or torch.int64", call, TypeError)
    if tri.ndim != 2 or tri.shape[1] != 3 or not 0 < len(tri) < _MOST_FACES:
        _fail("tri", list(tri.shape), f"[T, 3] with T from 1 to {_MOST_FACES - 1}", call)
    if count is not None and not (0 <= int(tri.min()) and int(tri.max()) < count):
        _fail("tri", f"indices from {int(tri.min())} to {int(tri.max())}", f"indices below {count}, the vertices", call)


def _check_pos(pos, call):
    check_floats("pos", pos, (2, 3), "[N, V, 4], or [V, 4] with ranges", call)
    if pos.shape[-1] != 4:
        _fail("pos", list(pos.shape), "[N, V, 4], or [V, 4] with ranges", call)
    if not bool(torch.isfinite(pos).all()):
        _fail("pos", "infinity or NaN", "finite numbers", call)


def _check_rast(rast, call):
    check_floats("rast", rast, (4,), "[N, H, W, 4]", call)
    if rast.shape[-1] != 4:
        _fail("rast", list(rast.shape), "[N, H, W, 4], what rasterize() returns", call)


def _pixels(resolution):
    if not isinstance(resolution, (list, tuple)) or len(resolution) != 2 or \
            not all(isinstance(side, numbers.Integral) for side in resolution):
        _fail("resolution", repr(resolution), "(height, width) in pixels", "rasterize")
    return int(resolution[0]), int(resolution[1])


def _checked_ranges(ranges, pos, tri):
    """[(first, count), ...], or None without ranges."""
    if pos.ndim == 3:
        if ranges is not None:
            _fail("ranges", "some with pos [N, V, 4]", "none, or pos [V, 4]", "rasterize")
        return None
    if ranges is None:
        _fail("ranges", "None", "[N, 2] with pos [V, 4]: each image's first triangle, and how many", "rasterize")
    if not isinstance(ranges, Tensor) or ranges.dtype not in (torch.int32, torch.int64) or ranges.ndim != 2 or \
            ranges.shape[1] != 2 or len(ranges) == 0:
        _fail("ranges", getattr(ranges, "shape", type(ranges).__name__), "a tensor of integers [N, 2]", "rasterize")
    pairs: List[Tuple[int, int]] = [tuple(pair) for pair in ranges.tolist()]
    for first, count in pairs:
        if first < 0 or count < 0 or first + count > len(tri):
            _fail("ranges", f"({first}, {count})", f"a part of {len(tri)} triangles", "rasterize")
    return pairs


def rasterize(glctx: Union[RasterizeCudaContext, RasterizeGLContext], pos: Tensor, tri: Tensor,
              resolution: Sequence[int], ranges: Optional[Tensor] = None,
              grad_db: bool = True) -> Tuple[Tensor, Tensor]:
    """Finds the triangle at each pixel's centre.

    pos         [N, V, 4] in clip space, or [V, 4] with ranges. Triangles are cut at the near plane z = -w and at the
                far plane z = w. If any position is behind the camera (w <= 0), z must be an affine function of w, as
                every projection matrix makes it; other positions raise ValueError
    tri         [T, 3], int32 or int64
    resolution  (height, width)
    ranges      [N, 2], the first triangle of each image and the number of its triangles. Images are rendered in turn
    grad_db     whether rast_db has gradients

    Returns rast [N, H, W, 4] with u, v, z/w and the triangle's index plus 1, all 0 in empty pixels, and rast_db
    [N, H, W, 4] with du/dX, du/dY, dv/dX, dv/dY per pixel. Gradients of u, v and rast_db reach pos; z/w has none, as in
    nvdiffrast."""
    with DepthPeeler(glctx, pos, tri, resolution, ranges, grad_db) as peeler:
        return peeler.rasterize_next_layer()


class DepthPeeler:
    """Rasterizes layer after layer, from the nearest surfaces to those behind them:

        with dr.DepthPeeler(glctx, pos, tri, resolution) as peeler:
            for _ in range(4):
                rast, rast_db = peeler.rasterize_next_layer()

    Arguments are those of rasterize(). antialias() of a layer follows the contours of its surfaces and of those before
    them. The n-th layer costs about as much as rasterize() with n surfaces at every pixel."""

    def __init__(self, glctx: Union[RasterizeCudaContext, RasterizeGLContext], pos: Tensor, tri: Tensor,
                 resolution: Sequence[int], ranges: Optional[Tensor] = None, grad_db: bool = True):
        if not isinstance(glctx, _Context):
            _fail("glctx", type(glctx).__name__, "RasterizeCudaContext() or RasterizeGLContext()", "rasterize",
                  TypeError)
        _check_pos(pos, "rasterize")
        _check_tri(tri, pos.shape[-2], "rasterize")
        self._context, self._pos, self._tri, self._grad_db = glctx, pos, tri, grad_db
        self._size, self._ranges = _pixels(resolution), _checked_ranges(ranges, pos, tri)
        self._layers = 0
        self._is_open = False

    def __enter__(self) -> DepthPeeler:
        self._is_open = True
        return self

    def __exit__(self, *error: Any) -> None:
        self._is_open = False

    def rasterize_next_layer(self) -> Tuple[Tensor, Tensor]:
        """(rast, rast_db) as rasterize() returns them, all 0 where there are fewer surfaces. Raises RuntimeError outside
        of the with statement."""
        if not self._is_open:
            _fail("rasterize_next_layer()", "a call outside of the with statement", "one within it", "DepthPeeler",
                  RuntimeError)
        self._layers += 1
        frames = Frames(self._context.device, self._pos, self._tri, self._ranges, self._size, "rasterize", self._layers)
        rast, rast_db = frames.rast(self._pos, self._grad_db)
        rast._dpr_frames = frames
        return rast, rast_db if getattr(self._context, "output_db", True) else rast_db[..., :0]


def _chosen(diff_attrs, channels):
    """Indices of the attributes that need derivatives."""
    if isinstance(diff_attrs, str) and diff_attrs == "all":
        return list(range(channels))
    if not isinstance(diff_attrs, (list, tuple)) or not all(isinstance(i, numbers.Integral) for i in diff_attrs) or \
            not all(-channels <= i < channels for i in diff_attrs):
        _fail("diff_attrs", repr(diff_attrs), f"'all', or a list of numbers below {channels}, the attributes",
              "interpolate")
    return [int(i) % channels for i in diff_attrs]


def _plain(tensor):
    """One that a backward pass may keep, which it may not of inference mode's."""
    is_kept = not isinstance(tensor, Tensor) or not tensor.is_inference() or torch.is_inference_mode_enabled()
    return tensor if is_kept else tensor.clone()


class _Interpolate(torch.autograd.Function):
    """(names of the outputs, attributes [1 or N, V, A], rast, rast_db or None, tri) to the outputs."""

    @staticmethod
    def _arrays(attr, rast, rast_db, tri):
        samples = {"rast": rast} if rast_db is None else {"rast": rast, "rast_db": rast_db}
        return {name: _arrays.to_numpy(tensor) for name, tensor in samples.items()}, *map(_arrays.to_numpy, (attr, tri))

    @staticmethod
    def forward(ctx, names, *tensors):
        ctx.names = names
        ctx.save_for_backward(*tensors)
        try:
            found = _rasterized.interpolated_at(*_Interpolate._arrays(*tensors), names)
        except _library.InvalidArgument as error:
            error.args = (str(error).replace("attributes (interpolate)", "attr (dpr.nvdiffrast.interpolate)"),)
            raise
        return tuple(map(torch.from_numpy, found.values()))

    @staticmethod
    def backward(ctx, *grads):
        wanted = ctx.needs_input_grad[1:4]
        return None, *_InterpolateGradients.apply(ctx.names, wanted, len(grads), *grads, *ctx.saved_tensors), None


@_torch.one_forward
class _InterpolateGradients(_torch.Derivative):
    """(names of the outputs, which gradients are wanted, how many outputs, their gradients, what _Interpolate was given) to
    gradients of the attributes, rast and rast_db."""

    @staticmethod
    def forward(names, wanted, count, *tensors):
        grads = {name: _arrays.to_numpy(grad) for name, grad in zip(names, tensors)}
        found = _rasterized.interpolated_gradients_at(*_Interpolate._arrays(*tensors[count:]), grads)
        return tuple(torch.from_numpy(found[name]) if is_wanted else None
                     for name, is_wanted in zip(("attributes", "rast", "rast_db"), wanted))


def interpolate(attr: Tensor, rast: Tensor, tri: Tensor, rast_db: Optional[Tensor] = None,
                diff_attrs: Union[str, Sequence[int], None] = None) -> Tuple[Tensor, Tensor]:
    """Interpolates attributes of vertices, attr [V, A], [1, V, A] or [N, V, A].

    Returns the attributes [N, H, W, A], 0 in empty pixels, and derivatives [N, H, W, 2 D] of the D attributes in
    diff_attrs, a list of indices or "all": dA/dX and dA/dY per pixel, in turn. diff_attrs needs rast_db. Gradients
    reach attr, rast and rast_db; those of empty pixels are ignored. Raises ValueError where attributes that are seen are
    not finite."""
    check_floats("attr", attr, (2, 3), "[V, A] or [N, V, A]", "interpolate")
    _check_rast(rast, "interpolate")
    table = attr if attr.ndim == 3 else attr[None]
    _check_tri(tri, table.shape[1], "interpolate")
    shape, channels = rast.shape[:3], attr.shape[-1]
    if len(table) not in (1, shape[0]):
        _fail("attr", list(attr.shape), f"[V, A], or 1 or {shape[0]} in the first dimension", "interpolate")
    numbers_of_rast = rast.detach()[..., 3]
    if bool((numbers_of_rast > len(tri)).any()):
        _fail("tri", list(tri.shape), f"the triangles of rast, at least {float(numbers_of_rast.max()):g}", "interpolate")
    chosen = [] if diff_attrs is None else _chosen(diff_attrs, channels)
    table, rast, rast_db = map(_plain, (table, rast, rast_db))
    if not chosen:
        values, = _Interpolate.apply(("values",), table, rast, None, tri)
        return values, rast.new_empty(*shape, 0)
    if rast_db is not None:
        check_floats("rast_db", rast_db, (4,), "[N, H, W, 4]", "interpolate")
    if rast_db is None or rast_db.shape != rast.shape:
        got = None if rast_db is None else list(rast_db.shape)
        _fail("rast_db", got, f"{list(rast.shape)} with diff_attrs", "interpolate")
    if chosen == list(range(channels)):
        return _Interpolate.apply(("values", "steps"), table, rast, rast_db, tri)
    values, = _Interpolate.apply(("values",), table, rast, None, tri)
    steps, = _Interpolate.apply(("steps",), table[..., chosen], rast, rast_db, tri)
    return values, steps


def antialias(color: Tensor, rast: Tensor, pos: Tensor, tri: Tensor, topology_hash: Optional[_TopologyHash] = None,
              pos_gradient_boost: float = 1.0) -> Tensor:
    """Blends colours [N, H, W, C] across contours, one pixel wide: Samples.resolve() without a blur. Gradients reach
    color and, multiplied by pos_gradient_boost, pos. The far plane's cut is no contour.

    If rast is not the very tensor that rasterize() returned, or pos and tri differ from rasterize()'s, the triangles
    are rasterized again. topology_hash has no effect."""
    check_floats("color", color, (4,), "[N, H, W, C]", "antialias")
    _check_rast(rast, "antialias")
    if color.shape[:3] != rast.shape[:3]:
        _fail("color", list(color.shape), [*rast.shape[:3], "C"], "antialias")
    if not bool(torch.isfinite(color).all()):
        _fail("color", "infinity or NaN", "finite numbers", "antialias")
    if not isinstance(topology_hash, (_TopologyHash, type(None))):
        _fail("topology_hash", type(topology_hash).__name__, "what antialias_construct_topology_hash() returns",
              "antialias", TypeError)
    _check_pos(pos, "antialias")
    _check_tri(tri, pos.shape[-2], "antialias")
    known = getattr(rast, "_dpr_frames", None) or None
    if known is None and (pos.ndim == 2 and len(rast) > 1 or pos.ndim == 3 and len(pos) != len(rast)):
        _fail("rast", f"{len(rast)} images that rasterize() did not return, with pos {list(pos.shape)}",
              "the tensor that rasterize() returned, or as many shapes in pos", "antialias")
    vertices = known.vertices_of(pos, tri) if known else None
    if vertices is None:
        device, ranges, layers = (known.device, known.ranges, known.layers) if known else ("", None, 1)
        known = Frames(device, pos, tri, ranges, rast.shape[1:3], "antialias", layers)
        vertices = known.vertices_of(pos, tri)
    return known.antialias(color, vertices, float(pos_gradient_boost))
