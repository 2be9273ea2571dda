"""Textures of PyTorch, and those of dpr.nvdiffrast."""
from typing import List, Optional, Sequence, Union

import torch
from torch import Tensor

from . import _arrays, _torch
from ._texture_maps import Lookup, Read

# In the library's words.
_FILTERS = {"nearest": "nearest", "linear": "bilinear", "linear-mipmap-nearest": "mipmap", "linear-mipmap-linear": "trilinear"}
_BOUNDARIES = {"wrap": "repeat", "clamp": "clamp", "zero": "zero", "cube": "clamp"}


def _fail(name, got, expected, error=ValueError, call="texture"):
    _arrays.fail(error, name, got, expected, "dpr.nvdiffrast." + call)


def check_floats(name, array, dimensions, shape, call):
    """Raises unless the array is a float32 CPU tensor with one of these numbers of dimensions. shape: for errors."""
    if not isinstance(array, Tensor):
        _fail(name, type(array).__name__, "a tensor of PyTorch", TypeError, call)
    if array.device.type != "cpu":
        _fail(name, f"a tensor on {array.device}", "one on the CPU", call=call)
    if array.dtype != torch.float32:
        _fail(name, str(array.dtype), "torch.float32", TypeError, call)
    if array.ndim not in dimensions or array.numel() == 0:
        _fail(name, list(array.shape), shape, call=call)


class Mip:
    """Mip levels of a texture, from texture_construct_mip() for texture()."""

    def __init__(self, levels: List[Tensor], is_cube: bool):
        self.levels, self.is_cube = levels, is_cube


def _halved(image, level):
    """The next mip level: means of 2 x 2 texels, or of 2 in a single row or column."""
    for axis in (-3, -2):
        size = image.shape[axis]
        if size == 1:
            continue
        if size % 2:
            _fail("tex", f"{size} texels along a side at mip level {level}", "an even number, or max_mip_level")
        image = image.unflatten(axis, (size // 2, 2))
        image = (image.select(axis, 0) + image.select(axis, 1)) * 0.5
    return image


def _smaller(tex, most):
    levels = []
    while (most is None or len(levels) < most) and max(tex.shape[-3:-1]) > 1:
        tex = _halved(tex, len(levels))
        levels.append(tex)
    return levels


def _check_texture(tex, is_cube):
    check_floats("tex", tex, (5,) if is_cube else (4,), "[N, 6, H, W, C]" if is_cube else "[N, H, W, C]", "texture")
    if is_cube and (tex.shape[1] != 6 or tex.shape[2] != tex.shape[3]):
        _fail("tex", list(tex.shape), "[N, 6, H, H, C], a cube map")


def texture_construct_mip(tex: Tensor, max_mip_level: Optional[int] = None, cube_mode: bool = False) -> Mip:
    """Mip levels for texture(), to be reused as long as the texture does not change."""
    _check_texture(tex, cube_mode)
    return Mip(_smaller(tex, max_mip_level), cube_mode)


@_torch.one_forward
class _Gradients(_torch.Derivative):
    """(gradient of the values, all tensors) to those of the tensors with these numbers."""

    @staticmethod
    def forward(lookup, numbers, grad_values, *tensors):
        found = Read(lookup, list(map(_arrays.to_numpy, tensors)), numbers).gradients([_arrays.to_numpy(grad_values)])
        return tuple(torch.from_numpy(found[i]) for i in numbers)


@_torch.one_forward
class _Tangents(_torch.Derivative):
    """(tangents of the tensors with these numbers, all tensors) to that of the values, a tuple of one."""

    @staticmethod
    def forward(lookup, numbers, *tensors):
        arrays = list(map(_arrays.to_numpy, tensors))
        moving = {i: tangent[None] for i, tangent in zip(numbers, arrays)}
        return (torch.from_numpy(Read(lookup, arrays[len(numbers):]).tangents(moving)[0][0]),)


@_torch.one_forward
class _Texture(torch.autograd.Function):
    """(tensors of a lookup) to values, a tuple of one."""

    @staticmethod
    def forward(lookup, *tensors):
        return (torch.from_numpy(Read(lookup, list(map(_arrays.to_numpy, tensors))).outputs[0]),)

    @staticmethod
    def setup_context(ctx, inputs, outputs):
        ctx.lookup, *tensors = inputs
        ctx.save_for_backward(*tensors)
        ctx.save_for_forward(*tensors)

    @staticmethod
    def backward(ctx, grad_values):
        numbers = tuple(i for i, wanted in enumerate(ctx.needs_input_grad[1:]) if wanted)
        found = dict(zip(numbers, _Gradients.apply(ctx.lookup, numbers, grad_values, *ctx.saved_tensors)))
        return (None, *(found.get(i) for i in range(len(ctx.saved_tensors))))

    @staticmethod
    def jvp(ctx, _, *tangents):
        numbers = tuple(i for i, tangent in enumerate(tangents) if tangent is not None)
        return _Tangents.apply(ctx.lookup, numbers, *(tangents[i] for i in numbers), *ctx.saved_tensors)

    @staticmethod
    def vmap(info, dimensions, *inputs):
        return _torch.one_by_one(_Texture, info, dimensions, *inputs)


def read(lookup, arrays):
    """A lookup's values; differentiable."""
    tensors = [array if isinstance(array, Tensor) else torch.from_dlpack(_arrays.to_numpy(array)) for array in arrays]
    return _Texture.apply(lookup, *tensors)[0]


def _levels(tex, mip, most, is_cube):
    if mip is None:
        return [tex, *_smaller(tex, most)]
    if isinstance(mip, Mip):
        if mip.is_cube != is_cube:
            _fail("mip", f"one of cube_mode={mip.is_cube}", f"cube_mode={is_cube}")
        mip = mip.levels
    elif not isinstance(mip, (list, tuple)):
        _fail("mip", type(mip).__name__, "what texture_construct_mip() returns, or a list of tensors", TypeError)
    for i, level in enumerate(mip, 1):
        check_floats("mip", level, (tex.ndim,), f"{tex.ndim} dimensions", "texture")
        wanted = [max(size >> i, 1) for size in tex.shape[-3:-1]]
        if list(level.shape) != [*tex.shape[:-3], *wanted, tex.shape[-1]]:
            _fail("mip", list(level.shape), [*tex.shape[:-3], *wanted, tex.shape[-1]])
    return [tex, *(mip if most is None else mip[:most])]


@_arrays.named("dpr.nvdiffrast.texture")
def texture(tex: Tensor, uv: Tensor, uv_da: Optional[Tensor] = None, mip_level_bias: Optional[Tensor] = None,
            mip: Union[Mip, Sequence[Tensor], None] = None, filter_mode: str = "auto", boundary_mode: str = "wrap",
            max_mip_level: Optional[int] = None) -> Tensor:
    """Samples a texture. Returns [N, H, W, C].

    tex             [N or 1, TH, TW, C], row 0 at v = 0; with boundary_mode="cube" [N or 1, 6, T, T, C], OpenGL's faces
                    +x, -x, +y, -y, +z, -z
    uv              [N, H, W, 2]; of cube maps directions [N, H, W, 3]
    uv_da           [N, H, W, 4], or of cube maps [N, H, W, 6]: du/dX, du/dY, dv/dX, ... per pixel, from interpolate()
    mip_level_bias  [N, H, W], added to the mip level; without uv_da it is the mip level
    mip             result of texture_construct_mip(), or a list of levels 1, 2, ...; by default built from tex
    filter_mode     "nearest", "linear", "linear-mipmap-nearest" or "linear-mipmap-linear"; "auto" is
                    "linear-mipmap-linear" with uv_da or mip_level_bias, else "linear"
    boundary_mode   "wrap", "clamp", "zero" or "cube"
    max_mip_level   the last mip level that is used

    Gradients reach tex and mip; uv unless the filter is "nearest"; and with "linear-mipmap-linear" uv_da and
    mip_level_bias."""
    for name, word, words in (("filter_mode", filter_mode, ("auto", *_FILTERS)), ("boundary_mode", boundary_mode, _BOUNDARIES)):
        if word not in words:
            _fail(name, repr(word), "one of " + ", ".join(words))
    is_cube = boundary_mode == "cube"
    _check_texture(tex, is_cube)
    size = 3 if is_cube else 2
    check_floats("uv", uv, (4,), f"[N, H, W, {size}]", "texture")
    shape = tuple(uv.shape[:3])
    for name, array, wanted in (("uv", uv, (*shape, size)), ("uv_da", uv_da, (*shape, 2 * size)),
                                ("mip_level_bias", mip_level_bias, shape)):
        if array is not None:
            check_floats(name, array, (len(wanted),), str(list(wanted)), "texture")
            if tuple(array.shape) != wanted:
                _fail(name, list(array.shape), list(wanted))
    if len(tex) not in (1, shape[0]):
        _fail("tex", list(tex.shape), f"{shape[0]} or 1 in the first dimension")
    has_levels = uv_da is not None or mip_level_bias is not None
    if filter_mode == "auto":
        filter_mode = "linear-mipmap-linear" if has_levels else "linear"
    is_mipmap = filter_mode.startswith("linear-mipmap")
    if is_mipmap and not has_levels:
        _fail("uv_da", "None", f"it or mip_level_bias with filter_mode={filter_mode!r}")

    levels = _levels(tex, mip, max_mip_level, is_cube) if is_mipmap else [tex]
    given = {"directions" if is_cube else "places": uv}
    if is_mipmap:
        given.update({name: array for name, array in (("steps", uv_da), ("levels", mip_level_bias)) if array is not None})
    tensors = [array if array.detach().sum().isfinite() else torch.nan_to_num(array, 0.0, 0.0, 0.0)
               for array in given.values()]
    names = (*given, *(f"texels[{i}]" for i in range(len(levels))))
    lookup = Lookup(names, _BOUNDARIES[boundary_mode], _FILTERS[filter_mode])
    return read(lookup, [*tensors, *(level.flatten(0, -4) for level in levels)])
