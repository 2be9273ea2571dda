"""Surfaces and lights for shading of one's own in PyTorch: glTF's metal and roughness, normal maps, environments, shadows.

    from dpr import shading

    samples = renderer.rasterize(vertices, faces, views, intrinsics)
    position = samples.interpolate(vertices)
    normal = shading.unit(samples.interpolate(shading.vertex_normals(vertices, faces)))
    to_eye = shading.unit(eye - position)
    color = environment.shade(normal, to_eye, base_color, metallic, roughness)
    image = samples.resolve(color * samples.mask[..., None])

Everything takes and returns tensors on the CPU and has derivatives of its tensors, unless it says otherwise. Directions are
unit vectors in world space, away from the surface. Where samples show nothing normals are 0, and colours finite.
"""
import functools
import math
from typing import Optional, Union

import numpy as np
import torch
from torch import Tensor

from . import _arrays, _vertex_normals as _normals
from ._losses import sum_at
from ._renderer import Renderer
from ._texture import texture as _texture

Number = Union[float, Tensor]
_LEAST = 1e-12  # of lengths
_LEAST_COVERED = 1e-4  # of a shadow map's texel
_LEAST_ALPHA = 1e-3  # of a microfacets' slopes: a mirror's highlights would be infinite
_DIELECTRIC = 0.04  # reflectance at normal incidence, of glTF


def _fail(name, got, expected):
    _arrays.fail(ValueError, name, got, expected, "dpr.shading")


def _require(name, tensor, last, expected):
    if not isinstance(tensor, Tensor):
        _fail(name, type(tensor).__name__, "a tensor of PyTorch, " + expected)
    if tensor.ndim == 0 or tensor.shape[-1] not in last:
        _fail(name, list(tensor.shape), expected)


def unit(vectors: Tensor) -> Tensor:
    """Vectors [..., 3] of length one; 0, without a derivative, where they have none."""
    _require("vectors", vectors, (3,), "[..., 3]")
    squared = vectors.square().sum(-1, keepdim=True)
    is_vector = squared > _LEAST**2
    length = torch.where(is_vector, squared, torch.ones_like(squared)).sqrt()
    return torch.where(is_vector, vectors, torch.zeros_like(vectors)) / length


def _dot(a, b):
    return (a * b).sum(-1, keepdim=True)


def _gathered(of_corners, indices, count):
    """[..., count, C]: sums of [..., F, 3, C] by the corners' indices [F, 3]."""
    return sum_at(of_corners.flatten(-3, -2), indices.reshape(-1), count)


def _vertex_normals(vertices, faces):
    corners = faces.long().T.contiguous()
    a, b, c = (vertices.index_select(-2, corner) for corner in corners)
    normals, sums = torch.cross(b - a, c - a, -1), torch.zeros_like(vertices)
    for corner in corners:
        sums = sums.index_add(-2, corner, normals)
    return unit(sums)


def vertex_normals(vertices: Tensor, faces: Tensor) -> Tensor:
    """Unit normals of vertices [V, 3] or [N, V, 3]: means of the faces' [F, 3], weighted by area, as the renderer's lights
    have them. 0 where a vertex has no face with area."""
    _require("vertices", vertices, (3,), "[V, 3] or [N, V, 3]")
    _require("faces", faces, (3,), "[F, 3]")
    return _normals.vertex_normals(_vertex_normals, vertices, faces)


def vertex_tangents(vertices: Tensor, faces: Tensor, texcoords: Tensor, face_texcoords: Optional[Tensor] = None) -> Tensor:
    """Tangents for normal maps: [T, 4], for texcoords [T, 2] that corners refer to by face_texcoords [F, 3] (faces if left
    out); to be interpolated with faces=face_texcoords. The first three are the unit direction in which u grows on the
    surface, weighted by area; the last is the side of v, 1 or -1, as glTF has it. A texture that is mirrored along a seam
    needs texcoords of its own on either side."""
    for name, tensor, last in (("vertices", vertices, 3), ("faces", faces, 3), ("texcoords", texcoords, 2)):
        _require(name, tensor, (last,), f"[..., {last}]")
    index = faces.long() if face_texcoords is None else face_texcoords.long()
    a, b, c = vertices[faces.long()].unbind(-2)
    (u1, v1), (u2, v2) = ((texcoords[index[:, k]] - texcoords[index[:, 0]]).unbind(-1) for k in (1, 2))
    area = u1 * v2 - u2 * v1
    along = ((b - a) * v2[:, None] - (c - a) * v1[:, None]) * area.sign()[:, None]
    sums = _gathered(torch.cat((along, area[:, None]), -1).unsqueeze(-2).expand(-1, 3, 4), index, texcoords.shape[0])
    return torch.cat((unit(sums[:, :3]), torch.where(sums[:, 3:] < 0, -1.0, 1.0).to(sums)), -1)


def mapped_normals(normals: Tensor, tangents: Tensor, texels: Tensor) -> Tensor:
    """Unit normals [..., 3] turned by texels of a normal map [..., 3]: along u, v and the normal, -1 to 1 (2 c - 1 of the
    linear values c of an image). tangents: [..., 4], interpolated ones of vertex_tangents()."""
    _require("tangents", tangents, (4,), "[..., 4]")
    _require("texels", texels, (3,), "[..., 3]")
    along = unit(tangents[..., :3] - normals * _dot(normals, tangents[..., :3]))
    across = torch.cross(normals, along, -1) * tangents[..., 3:]
    return unit(along * texels[..., :1] + across * texels[..., 1:2] + normals * texels[..., 2:])


def texture_at(texture: Tensor, texcoords: Tensor) -> Tensor:
    """Bilinear values [..., C] of a texture [H, W, C], row 0 on top, at texcoords [..., 2], v up, repeated beyond [0, 1]: as
    the renderer has its own."""
    _require("texcoords", texcoords, (2,), "[..., 2]")
    if not isinstance(texture, Tensor) or texture.ndim != 3:
        _fail("texture", list(texture.shape) if isinstance(texture, Tensor) else type(texture).__name__, "a tensor [H, W, C]")
    rows = texcoords.reshape(1, 1, -1, 2)
    found = _texture(texture.flip(0)[None].contiguous(), rows.contiguous(), filter_mode="linear", boundary_mode="wrap")
    return found.reshape(*texcoords.shape[:-1], texture.shape[-1])


def _share(numbers):
    """Clamped to [0, 1]. At both ends the gradient is that of the inside; clamp() of some versions of PyTorch has 0 there."""
    numbers = torch.where(numbers < 0, torch.zeros_like(numbers), numbers)
    return torch.where(numbers > 1, torch.ones_like(numbers), numbers)


def _reflectances(base_color, metallic):
    """(diffuse, specular at normal incidence)"""
    return base_color * (1 - metallic), _DIELECTRIC + (base_color - _DIELECTRIC) * metallic


def metallic_roughness(normal: Tensor, to_eye: Tensor, to_light: Tensor, base_color: Tensor, metallic: Number,
                       roughness: Number) -> Tensor:
    """How much light [..., 3] a surface sends to the eye, of one unit of irradiance that falls straight on it: glTF 2.0's
    reflection (appendix B: Lambert, GGX, Smith's masking, Schlick's Fresnel term) times the cosine of the light.

    normal, to_eye, to_light  [..., 3]
    base_color                [..., 3] or [3], linear RGB from 0 to 1
    metallic, roughness       [..., 1] or a number, from 0 to 1; roughness squared is GGX's alpha, at least 0.001
    """
    for name, tensor in (("normal", normal), ("to_eye", to_eye), ("to_light", to_light)):
        _require(name, tensor, (3,), "[..., 3]")
    half = unit(to_eye + to_light)
    cos_light, cos_eye = _dot(normal, to_light).clamp(min=0), _dot(normal, to_eye).clamp(min=1e-4)
    cos_half, cos_both = _dot(normal, half).clamp(0, 1), _dot(to_eye, half).clamp(0, 1)
    squared = torch.as_tensor(roughness, dtype=normal.dtype).square().clamp(min=_LEAST_ALPHA).square()
    distribution = squared / (math.pi * (cos_half.square() * (squared - 1) + 1).square())
    masking = cos_light * (cos_eye.square() * (1 - squared) + squared).sqrt() + \
        cos_eye * (cos_light.square() * (1 - squared) + squared).sqrt()
    diffuse, straight = _reflectances(base_color, metallic)
    fresnel = straight + (1 - straight) * (1 - cos_both) ** 5
    specular = fresnel * distribution * 0.5 / masking.clamp(min=1e-6)
    return ((1 - fresnel) * diffuse / math.pi + specular) * cos_light


def _texel_directions(height, width):
    """(directions [H W, 3], solid angles [H W]) of an equirectangular image, in double precision."""
    polar = (np.arange(height) + 0.5) / height * np.pi
    azimuth = ((np.arange(width) + 0.5) / width - 0.5) * 2 * np.pi
    sine, y = np.sin(polar)[:, None], np.cos(polar)[:, None]
    directions = np.stack(np.broadcast_arrays(sine * np.sin(azimuth), y, -sine * np.cos(azimuth)), -1)
    edges = np.cos(np.arange(height + 1) / height * np.pi)
    angles = np.repeat((edges[:-1] - edges[1:]) * 2 * np.pi / width, width)
    return directions.reshape(-1, 3), angles


@functools.lru_cache(maxsize=None)
def _filter(height, alpha):
    """Means of an image [height, 2 height] as rows of a matrix, one for each texel's direction: by the cosine, and for an
    alpha by GGX seen along the normal (Karis 2013)."""
    directions, angles = _texel_directions(height, 2 * height)
    cosines = np.clip(directions @ directions.T, 0, 1)
    weights = cosines * angles
    if alpha is not None:
        half = (1 + directions @ directions.T) / 2  # the square of the half vector's cosine
        weights = weights * alpha**2 / (half * (alpha**2 - 1) + 1) ** 2
    return torch.from_numpy((weights / weights.sum(1, keepdims=True)).astype(np.float32))


@functools.lru_cache(maxsize=None)
def _reflected_shares():
    """[2, roughness, cosine]: what a surface reflects of an even light: share of its reflectance at normal incidence, and
    what comes beside (Karis' second sum), at the middles of 32 x 32 cells."""
    cells, count = 32, 2048
    middles = (np.arange(cells) + 0.5) / cells
    cos_eye = middles[None, :, None]
    squared = np.maximum(middles**2, _LEAST_ALPHA)[:, None, None] ** 2
    turn = 2 * np.pi * (np.arange(count) + 0.5) * (5**0.5 - 1) / 2
    level = (np.arange(count) + 0.5) / count
    cos_half = np.sqrt((1 - level) / (1 + (squared - 1) * level))
    cos_both = np.sqrt(1 - cos_half**2) * np.cos(turn) * np.sqrt(1 - cos_eye**2) + cos_half * cos_eye
    cos_light = 2 * cos_both * cos_half - cos_eye
    masking = cos_light * np.sqrt(cos_eye**2 * (1 - squared) + squared) + \
        cos_eye * np.sqrt(np.maximum(cos_light, 0) ** 2 * (1 - squared) + squared)
    is_seen = (cos_light > 0) & (cos_both > 0)
    shares = np.where(is_seen, 2 * cos_light * cos_both / np.maximum(masking * cos_half, 1e-9), 0)
    grazing = (1 - np.clip(cos_both, 0, 1)) ** 5
    table = np.stack([((1 - grazing) * shares).mean(-1), (grazing * shares).mean(-1)])
    return torch.from_numpy(table.astype(np.float32))


def _bilinear(image, x, y, wraps):
    """Values [n, C] of an image [H, W, C] at places in texels, whose middles are halves; clamped, or x repeated."""
    height, width = image.shape[:2]
    x, y = x - 0.5, y - 0.5
    left, top = x.detach().floor(), y.detach().floor()
    across, down = (x - left)[:, None], (y - top)[:, None]
    columns = [left.long() + k for k in (0, 1)]
    columns = [column % width if wraps else column.clamp(0, width - 1) for column in columns]
    rows = [(top.long() + k).clamp(0, height - 1) for k in (0, 1)]
    upper, lower = (image[row, columns[0]] * (1 - across) + image[row, columns[1]] * across for row in rows)
    return upper * (1 - down) + lower * down


def _with_poles(image):
    """An equirectangular image with the means of its first and last rows beyond them, at the poles."""
    return torch.cat([image[:1].mean(1, keepdim=True).expand_as(image[:1]), image,
                      image[-1:].mean(1, keepdim=True).expand_as(image[-1:])])


class Environment:
    """Light from all around, of an image.

    image  [H, W, 3], linear RGB, equirectangular: row 0 is up (+y), and its middle column lies towards -z, +x to the right
           of it; of any size, twice as wide as high. Straight up is the mean of row 0, straight down that of the last

    Reflections are Karis' split sum: means of the image by GGX for six degrees of roughness, each of 32 x 64 directions, and
    shares of an even light. A mirror has the image itself. Beside sums over all directions they are 2% off in an even light;
    where light and dark share the sky 3% along the normal, and 15% for a rough metal seen aslant. The means are linear in the
    image and have its derivatives; the first use in a process takes a second. Raises ValueError for another shape, and for
    numbers that are not finite.
    """

    _HEIGHT, _LEVELS = 32, 6

    def __init__(self, image: Tensor):
        _require("image", image, (3,), "[H, 2 H, 3]")
        if image.ndim != 3 or image.shape[1] != 2 * image.shape[0] or not image.shape[0]:
            _fail("image", list(image.shape), "[H, 2 H, 3]")
        if not image.detach().isfinite().all():
            _fail("image", "numbers that are not finite", "finite ones")
        self.image = image
        self._with_poles = _with_poles(image)
        size = (self._HEIGHT, 2 * self._HEIGHT)
        small = torch.nn.functional.adaptive_avg_pool2d(image.permute(2, 0, 1), size).permute(1, 2, 0).reshape(-1, 3)
        alphas = [None, *((k / (self._LEVELS - 1)) ** 2 for k in range(1, self._LEVELS))]
        self._means = [_with_poles((_filter(self._HEIGHT, alpha).to(image.dtype) @ small).reshape(*size, 3))
                       for alpha in alphas]

    @staticmethod
    def _at(with_poles, directions):
        x, y, z = directions.reshape(-1, 3).unbind(-1)
        flat = x.square() + z.square()
        is_pole = flat <= _LEAST  # where the image has no derivative, nor has a direction of length 0
        across = torch.atan2(x.masked_fill(is_pole, 0), (-z).masked_fill(is_pole, 1)) / (2 * math.pi) + 0.5
        height, width = with_poles.shape[0] - 2, with_poles.shape[1]
        row = torch.atan2(flat.clamp(min=_LEAST).sqrt(), torch.where(is_pole, y.detach(), y)) / math.pi * height
        # A pole lies half a row from the next row's middle.
        row = row + 1 + (row - 0.5).clamp(max=0) + (row + 0.5 - height).clamp(min=0)
        return _bilinear(with_poles, across * width, row, True).reshape(*directions.shape[:-1], 3)

    def light(self, directions: Tensor) -> Tensor:
        """Radiance [..., 3] from directions [..., 3]."""
        return self._at(self._with_poles, directions)

    def diffuse(self, normals: Tensor) -> Tensor:
        """What a white surface without gloss sends, [..., 3]: the mean of the radiance by the cosine."""
        return self._at(self._means[0], normals)

    def specular(self, directions: Tensor, roughness: Number) -> Tensor:
        """Mean radiance [..., 3] around reflected directions [..., 3], for a roughness [..., 1] or a number, 0 to 1."""
        levels = [self._with_poles, *self._means[1:]]
        roughness = torch.as_tensor(roughness, dtype=directions.dtype)
        known = _arrays.known(roughness)
        if known is not None and np.isnan(known).any():
            _fail("roughness", "NaN", "[..., 1] or a number, 0 to 1")
        place = _share(roughness) * (len(levels) - 1)
        lower = place.detach().floor().clamp(max=len(levels) - 2)
        above, total = place - lower, torch.zeros_like(directions)
        for k, level in enumerate(levels):
            is_lower, is_upper = lower == k, lower == k - 1
            if bool((is_lower | is_upper).any()):
                weight = torch.where(is_lower, 1 - above, torch.where(is_upper, above, torch.zeros_like(above)))
                total = total + weight * self._at(level, directions)
        return total

    def shade(self, normal: Tensor, to_eye: Tensor, base_color: Tensor, metallic: Number, roughness: Number) -> Tensor:
        """Light [..., 3] that the surface sends to the eye; arguments as metallic_roughness() has them."""
        for name, tensor in (("normal", normal), ("to_eye", to_eye), ("base_color", base_color)):
            _require(name, tensor, (3,), "[..., 3]")
        cosine = _dot(normal, to_eye).clamp(0, 1)
        rough = _share(torch.as_tensor(roughness, dtype=normal.dtype)).expand_as(cosine)
        table = _reflected_shares().to(normal.dtype)
        places = cosine.reshape(-1) * table.shape[2], rough.reshape(-1) * table.shape[1]
        shares = _bilinear(table.permute(1, 2, 0), *places, False).reshape(*cosine.shape[:-1], 2)
        diffuse, straight = _reflectances(base_color, metallic)
        reflected = straight * shares[..., :1] + shares[..., 1:]
        mirrored = 2 * _dot(normal, to_eye) * normal - to_eye
        return (1 - reflected) * diffuse * self.diffuse(normal) + reflected * self.specular(mirrored, roughness)


class ShadowMap:
    """Which points a light reaches, by how the mesh looks from it, with gradients of what throws the shadow.

    renderer         of the light's image: its size is the map's, and its noise on the pixel, blur, the shadows' edges
    vertices, faces  [V, 3] and [F, 3], of all that throws shadows
    view, intrinsics [1, 4, 4] and [1, 4] or [1, 1], the light's camera, as Renderer has cameras: of a spot a pinhole, of a
                     directional light an orthographic one
    bias             a point counts as lit up to such a distance behind what the light sees, of the map's depths

    The map holds how much of a texel the mesh covers, and mean and mean square of its depths there, under the noise; a point
    behind the mean is lit by Chebyshev's bound (variance shadow maps, Donnelly and Lauritzen 2006) and by what is not
    covered: exact for one edge above a surface facing the light, or above none, too bright where several surfaces throw
    shadows on top of each other. On a surface that shades itself the map's resolution shows:
    differences over a small step are noisier than gradients there, and agree with the gradients' mean over a motion of some
    texels. Raises ValueError for cameras of other forms.
    """

    def __init__(self, renderer: Renderer, vertices: Tensor, faces: Tensor, view: Tensor, intrinsics: Tensor,
                 bias: float = 0.005):
        view, intrinsics = torch.as_tensor(view), torch.as_tensor(intrinsics)
        if tuple(view.shape) != (1, 4, 4):
            _fail("view", list(view.shape), "[1, 4, 4]")
        if tuple(intrinsics.shape) not in ((1, 4), (1, 1)):
            _fail("intrinsics", list(intrinsics.shape), "[1, 4], or [1, 1] of an orthographic camera")
        self._view, self._intrinsics, self._size = view[0], intrinsics[0], (renderer.height, renderer.width)
        samples = renderer.rasterize(vertices, faces, view, intrinsics)
        seen = samples.depth.detach()[samples.mask]
        self._near, far = (float(seen.min()), float(seen.max())) if seen.numel() else (0.0, 1.0)
        self._range = max(far - self._near, _LEAST, 1e-6 * abs(far))
        self._variance = bias**2
        covered = samples.mask.to(samples.depth)
        depth = (samples.depth - self._near) / self._range * covered
        self._moments = samples.resolve(torch.stack((depth, depth.square(), covered), -1))[0]

    def visibility(self, positions: Tensor) -> Tensor:
        """[..., 1] from 0 to 1, of points [..., 3]; 1 outside what the light's camera sees."""
        _require("positions", positions, (3,), "[..., 3]")
        points = positions.reshape(-1, 3) @ self._view[:3, :3].T + self._view[:3, 3]
        depth = -points[:, 2]
        height, width = self._size
        if self._intrinsics.shape[0] == 1:
            scale = height / self._intrinsics[0]
            x, y = width / 2 + points[:, 0] * scale, height / 2 - points[:, 1] * scale
            is_seen = torch.ones_like(depth, dtype=torch.bool)
        else:
            is_seen = depth > 0
            divisor = torch.where(is_seen, depth, torch.ones_like(depth))
            fx, fy, cx, cy = self._intrinsics.unbind()
            x, y = cx + fx * points[:, 0] / divisor, cy - fy * points[:, 1] / divisor
        is_seen = is_seen & (x >= 0) & (x <= width) & (y >= 0) & (y <= height)
        *moments, covered = _bilinear(self._moments, x.clamp(0, width), y.clamp(0, height), False).unbind(-1)
        covered = _share(covered)
        mean, mean_square = (moment / covered.clamp(min=_LEAST_COVERED) for moment in moments)
        behind = ((depth - self._near) / self._range - mean).clamp(min=0)
        variance = (mean_square - mean.square()).clamp(min=self._variance)
        lit = 1 - covered + covered * variance / (variance + behind.square())
        return torch.where(is_seen, lit, torch.ones_like(lit)).reshape(*positions.shape[:-1], 1)
