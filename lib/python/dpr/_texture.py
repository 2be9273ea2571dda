"""Textures of dpr.nvdiffrast."""
import functools
from typing import List, Optional, Sequence, Union

import torch
from torch import Tensor

from . import _arrays, _rows

_FILTERS = ("auto", "nearest", "linear", "linear-mipmap-nearest", "linear-mipmap-linear")
_BOUNDARIES = ("wrap", "clamp", "zero", "cube")
_LEAST_AREA = 1e-12  # of footprints, in texels


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


@functools.lru_cache(maxsize=64)
def _cube_places(size):
    """(places, corners) of faces with a border one texel wide. places [6 (size + 2)^2]: rows of a table that holds the
    6 size^2 texels and then 24 means for the borders' corners. corners [24, 3]: the texels of each mean."""
    line = (torch.arange(size + 2, dtype=torch.float64) - 0.5) / size
    t, s = torch.meshgrid(line, line, indexing="ij")
    x, y, one = 2 * s - 1, 2 * t - 1, torch.ones_like(s)
    directions = torch.stack([torch.stack(axes, -1) for axes in (
        (one, -y, -x), (-one, -y, x), (x, one, y), (x, -one, -y), (x, -y, one), (-x, -y, -one))])
    face, coords, _ = _on_cube(directions.reshape(-1, 3))
    column, row = (coords * size).floor().long().clamp(0, size - 1).unbind(-1)
    places = ((face * size + row) * size + column).reshape(6, size + 2, size + 2)
    ends = torch.tensor([0, -1])
    inner = torch.tensor([1, -2])
    columns = places[:, ends[:, None], inner], places[:, inner[:, None], ends], places[:, inner[:, None], inner]
    places[:, ends[:, None], ends] = (6 * size * size + torch.arange(24)).reshape(6, 2, 2)
    return places.reshape(-1), torch.stack([column.reshape(-1) for column in columns], -1)


def _on_cube(direction, footprint=None):
    """(face [K], (s, t) on that face [K, 2], footprint of (s, t) [K, 2, 2]) of directions [K, 3] with the footprint
    [K, 3, 2], their change per pixel to the right and up. Faces are OpenGL's. Differentiable."""
    size = direction.detach().abs()
    axis = torch.where(size[:, 2] > size[:, :2].amax(1), 2, torch.where(size[:, 1] > size[:, 0], 1, 0))
    sign = torch.where(direction.detach().gather(1, axis[:, None])[:, 0] < 0, -1, 1)
    axes = torch.stack([torch.tensor([2, 0, 0])[axis], torch.tensor([1, 2, 1])[axis], axis], 1)
    plus = torch.ones_like(sign)
    signs = torch.stack([torch.where(axis == 0, -sign, torch.where(axis == 1, plus, sign)),
                         torch.where(axis == 1, sign, -plus), sign], 1).to(direction.dtype)
    turned = direction.gather(1, axes) * signs
    depth = turned[:, 2:] + (turned[:, 2:] == 0)
    on_face = turned[:, :2] / depth
    if footprint is not None:
        turned = footprint.gather(1, axes[..., None].expand(-1, -1, 2)) * signs[..., None]
        footprint = 0.5 * (turned[:, :2] - on_face[..., None] * turned[:, 2:]) / depth[..., None]
    return 2 * axis + (sign < 0).long(), on_face * 0.5 + 0.5, footprint


class _Texels:
    """All mip levels of a texture in one table of texels."""

    def __init__(self, levels, boundary):
        channels = levels[0].shape[-1]
        self.boundary, parts, self._first, self._places_first, places = boundary, [], [], [], []
        row = place = 0
        for level in levels:
            flat = level.reshape(-1, channels)
            if boundary == "cube":
                texels = level.flatten(1, -2)
                own_places, corners = _cube_places(level.shape[-2])
                means = sum(texels[:, corner] for corner in corners.unbind(1)) / 3
                flat = torch.cat([texels, means], 1).reshape(-1, channels)
                places.append(own_places)
                self._places_first.append(place)
                place += len(own_places)
            parts.append(flat)
            self._first.append(row)
            row += len(flat)
        self._zero, self._count = row, len(levels)
        if boundary == "zero":
            parts.append(parts[0].new_zeros(1, channels))
        self.table = torch.cat(parts) if len(parts) > 1 else parts[0]
        self._heights, self._widths = ([level.shape[axis] for level in levels] for axis in (-3, -2))
        self._places = torch.cat(places) if places else None

    def __len__(self):
        return self._count

    def _of(self, numbers, level):
        return numbers[0] if self._count == 1 else torch.tensor(numbers).index_select(0, level)

    def _within(self, place, size):
        """(texel, whether it exists, None for always) for texels -1 to size along an axis. Cube maps count from their
        border."""
        if self.boundary == "cube":
            return place + 1, None
        last = size - 1
        if self.boundary == "wrap":
            return torch.where(place < 0, last, torch.where(place > last, 0, place)), None
        is_inside = (place >= 0) & (place <= last) if self.boundary == "zero" else None
        return torch.where(place < 0, 0, torch.where(place > last, last, place)), is_inside

    def _rows(self, level, batch, face, columns, rows):
        """Table rows of the texels in these rows and columns, row by row."""
        height, width, first = (self._of(numbers, level) for numbers in (self._heights, self._widths, self._first))
        columns = [self._within(place, width) for place in columns]
        rows = [self._within(place, height) for place in rows]
        if self.boundary == "cube":
            first, of_batch = self._of(self._places_first, level), first + batch * (6 * width * width + 24)
            lines = [first + (face * (width + 2) + row) * (width + 2) for row, _ in rows]
            return [of_batch + self._places.index_select(0, line + column) for line in lines for column, _ in columns]
        lines = [(first + (batch * height + row) * width, is_inside) for row, is_inside in rows]
        if self.boundary != "zero":
            return [line + column for line, _ in lines for column, _ in columns]
        return [torch.where(of_line & of_column, line + column, self._zero)
                for line, of_line in lines for column, of_column in columns]

    def _places_of(self, level, coords):
        """(x, y) in texels, [K] each."""
        if self.boundary == "wrap":
            coords = coords - coords.detach().floor()
        elif self.boundary in ("clamp", "cube"):
            coords = coords.clamp(0, 1)
        else:
            coords = coords.clamp(-2, 3)
        return coords[:, 0] * self._of(self._widths, level), coords[:, 1] * self._of(self._heights, level)

    def nearest(self, batch, face, coords):
        x, y = (place.detach().floor().long() for place in self._places_of(0, coords))
        if self.boundary == "cube":
            x, y = (place.clamp(max=self._widths[0] - 1) for place in (x, y))
        return _rows.rows(self.table, self._rows(0, batch, face, [x], [y])[0])

    def linear(self, level, batch, face, coords):
        """(indices [4, K], weights [4, K]) of the four texels around each place."""
        x, y = (place - 0.5 for place in self._places_of(level, coords))
        column, row = x.detach().floor(), y.detach().floor()
        x, y, column, row = x - column, y - row, column.long(), row.long()
        index = self._rows(level, batch, face, [column, column + 1], [row, row + 1])
        return torch.stack(index), torch.stack([(1 - x) * (1 - y), x * (1 - y), (1 - x) * y, x * y])

    def level_of(self, footprint, bias):
        """Fractional mip levels [K], by the longer axis of the ellipse that a pixel covers."""
        level = 0.0
        if footprint is not None:
            area = footprint * footprint.new_tensor([[self._widths[0]], [self._heights[0]]])
            across, up = area[..., 0], area[..., 1]
            a, b, c = (left[:, 0] * right[:, 0] + left[:, 1] * right[:, 1]
                       for left, right in ((across, across), (up, up), (across, up)))
            root = (0.25 * (a - b).square() + c.square()).clamp(min=_LEAST_AREA ** 2).sqrt()
            level = 0.5 * torch.log2((0.5 * (a + b) + root).clamp(min=_LEAST_AREA))
        if bias is not None:
            level = level + bias.reshape(-1)
        return torch.nan_to_num(level, 0.0).clamp(0, self._count - 1)


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
    for name, word, words in (("filter_mode", filter_mode, _FILTERS), ("boundary_mode", boundary_mode, _BOUNDARIES)):
        if word not in words:
            _fail(name, repr(word), "one of " + ", ".join(words))
    is_cube = boundary_mode == "cube"
    _check_texture(tex, is_cube)
    size = 3 if is_cube else 2
    check_floats("uv", uv, (4,), f"[N, H, W, {size}]", "texture")
    shape, count = tuple(uv.shape[:3]), uv.shape[:3].numel()
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

    texels = _Texels(_levels(tex, mip, max_mip_level, is_cube) if is_mipmap else [tex], boundary_mode)
    batch = torch.arange(shape[0]).repeat_interleave(count // shape[0]) if len(tex) > 1 else 0
    coords = torch.nan_to_num(uv, 0.0, 0.0, 0.0).reshape(count, size)
    footprint = uv_da.reshape(count, size, 2) if is_mipmap and uv_da is not None else None
    face = 0
    if is_cube:
        face, coords, footprint = _on_cube(coords, footprint)
    if filter_mode == "nearest":
        return texels.nearest(batch, face, coords).reshape(*shape, -1)
    if not is_mipmap:
        taps = [texels.linear(0, batch, face, coords)]
    else:
        level = texels.level_of(footprint, mip_level_bias)
        if filter_mode == "linear-mipmap-nearest":
            taps = [texels.linear((level.detach() + 0.5).floor().long(), batch, face, coords)]
        else:
            lower = level.detach().floor().long().clamp(max=max(len(texels) - 2, 0))
            upper, part = (lower + 1).clamp(max=len(texels) - 1), level - lower
            taps = [(index, weights * of_level) for (index, weights), of_level in (
                (texels.linear(lower, batch, face, coords), 1 - part),
                (texels.linear(upper, batch, face, coords), part))]
    return _rows.mixed(texels.table, *(torch.cat(parts) for parts in zip(*taps))).reshape(*shape, -1)
