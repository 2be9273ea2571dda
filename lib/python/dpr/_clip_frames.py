"""Samples of positions in clip space, for the operations of nvdiffrast."""
import collections

import torch

from . import _clip_space, _merged, _rows, _torch
from ._renderer import Renderer

_SHARP = {"preset": "pixel", "sigma": 1e-12, "gamma": 1e-9}
"""Blends samples across contours over one pixel without a further blur. Only the nearest surface is visible."""
_PLANE_ROUNDING = 1e-6


class _Frame:
    """Samples of N shapes of one topology, or of N meshes of as many triangles and vertices.

    faces   [F, 3], or [N, F, 3], the triangles of each
    firsts  [N], the index of each one's first triangle in tri
    """

    def __init__(self, device, pos, faces, firsts, size, call, layers):
        """pos: [N, V, 4]; size: (height, width). Shows the last of so many layers."""
        height, width = size
        self.faces, self.firsts, self._height, self._width, self._call = faces, firsts, height, width, call
        camera, self.vertices = self._placed(pos)
        renderer = Renderer(width, height, device=device, znear=camera.znear, zfar=camera.zfar, **_SHARP)
        self._camera = camera
        views_and_intrinsics = camera.views_and_intrinsics(len(pos), width, height)
        self._samples = renderer._rasterize(self.vertices, faces, *views_and_intrinsics, layers).layers[-1]
        self._has_gradient = self.vertices.requires_grad

    def _placed(self, pos):
        used = torch.full((pos.shape[1],), self.faces.ndim == 3)
        if self.faces.ndim == 2:
            used[self.faces.long().reshape(-1)] = True
        faces = self.faces if self.faces.ndim == 2 else None
        camera = _clip_space.camera_of(pos, faces, (self._height, self._width), "dpr.nvdiffrast." + self._call)
        return camera, camera.vertices(pos, used, self._width, self._height)

    def _inner(self, samples):
        margin = self._samples.margin
        return samples[:, margin:margin + self._height, margin:margin + self._width]

    def rast(self, pos, grad_db):
        """([N, H, W, 4], [N, H, W, 4])"""
        samples, count_of_faces = self._samples, self.faces.shape[-2]
        faces = self.faces.long().reshape(-1, 3)
        face_id, barycentrics, depth = map(self._inner, (samples.face_id, samples.barycentrics, samples.depth))
        count = face_id.numel()
        covered = (face_id >= 0).reshape(-1).nonzero()[:, 0]
        face = face_id.reshape(-1).index_select(0, covered)
        shape = covered.div(self._height * self._width, rounding_mode="floor")
        row = face + shape * count_of_faces if self.faces.ndim == 3 else face
        corners = [corner.contiguous() for corner in
                   (faces.index_select(0, row) + (shape * pos.shape[1])[:, None]).unbind(1)]
        weights = _rows.rows(barycentrics.reshape(-1, 3), covered)
        of_w = pos[..., 3].reshape(-1)
        if self._camera.is_perspective:
            own = weights.detach().unbind(1)
            z, w = (sum(table.index_select(0, corner) * weight for corner, weight in zip(corners, own))
                    for table in (pos[..., 2].detach().reshape(-1), of_w.detach()))
            of_depth = z / w
        else:  # an orthographic camera's weights are linear on the screen
            of_depth = depth.detach().reshape(-1).index_select(0, covered) - 2
            weights = weights / torch.stack([of_w.index_select(0, corner) for corner in corners], 1)
            weights = weights / weights.sum(1, keepdim=True)
        is_seen = of_depth.abs() <= 1 + _PLANE_ROUNDING
        number = (face + 1 + self.firsts.index_select(0, shape)).to(pos.dtype)
        found = torch.cat([weights[:, :2], of_depth[:, None], number[:, None]], 1) * is_seen[:, None]
        derivatives = self._derivatives(*((pos, weights) if grad_db else (pos.detach(), weights.detach())), corners,
                                        shape * count_of_faces + face)
        return tuple(_rows.spread(table, covered, count).reshape(*face_id.shape, 4)
                     for table in (found, derivatives * is_seen[:, None]))

    def _derivatives(self, pos, weights, corners, place):
        """[K, 4]: du/dX, du/dY, dv/dX, dv/dY per pixel, of weights [K, 3]. place: shape times faces plus face."""
        table = pos.reshape(-1, 4)
        if len(pos) * self.faces.shape[-2] <= len(place):
            shapes = torch.arange(len(pos))[:, None, None] * pos.shape[1]
            slopes = _slopes(_rows.rows(table, (self.faces.long() + shapes).reshape(-1)).reshape(-1, 3, 4))
            slopes = _rows.rows(slopes, place)
        else:
            slopes = _slopes(torch.stack([_rows.rows(table, corner) for corner in corners], 1))
        of_u, of_v, of_all = slopes.split(2, 1)
        w = sum(table[:, 3].index_select(0, corner) * weight for corner, weight in zip(corners, weights.unbind(1)))
        scale = w[:, None] * w.new_tensor([2 / self._width, 2 / self._height])
        return torch.cat([(own - weight * of_all) * scale for own, weight in zip((of_u, of_v), weights.split(1, 1))], 1)

    def vertices_of(self, pos):
        """The camera's vertices for positions [N, V, 4], differentiable; None if the samples belong to other positions,
        or lack gradients that are wanted."""
        is_wanted = pos.requires_grad and torch.is_grad_enabled()
        if pos.shape[:2] != self.vertices.shape[:2] or is_wanted and not self._has_gradient:
            return None
        vertices = self._placed(pos)[1]
        return vertices if torch.equal(vertices, self.vertices) else None

    def antialias(self, color, vertices, boost):
        margin = self._samples.margin
        if boost != 1:
            vertices = vertices.detach() + boost * (vertices - vertices.detach())
        tensors = [vertices if tensor is self.vertices else tensor for tensor in self._samples._tensors]
        around = torch.nn.functional.pad(color.permute(0, 3, 1, 2), (margin,) * 4, mode="replicate").permute(0, 2, 3, 1)
        return _torch.resolve(self._samples._rasterized, around, tensors)


def _slopes(corners):
    """[R, 6] of corners [R, 3, 4] in clip space: d/dX and d/dY in NDC of u / w, v / w and 1 / w."""
    places = corners[..., (0, 1, 3)].double()
    lines = torch.cross(places.roll(-1, 1), places.roll(-2, 1), dim=-1)
    area = (lines[:, 0] * places[:, 0]).sum(1)
    slopes = lines[..., :2] / torch.where(area == 0, torch.ones_like(area), area)[:, None, None]
    return torch.cat([slopes[:, 0], slopes[:, 1], slopes.sum(1)], 1).to(corners.dtype)


class _Part:
    """Images of a rasterize() call that one frame has.

    images  their numbers
    index   [N, V], of the vertices in pos; None of a whole pos [N, V, 4]
    """

    def __init__(self, images, index, frame=None):
        self.images, self._index, self.frame = images, index, frame

    def positions(self, pos):
        """[N, V, 4]"""
        if self._index is None:
            return pos
        return _rows.rows(pos, self._index.reshape(-1)).reshape(*self._index.shape, 4)


def _mesh_of(tri):
    """(indices [V] of the vertices, triangles of these) of triangles; an index that none uses is another's instead."""
    tri = tri.long()
    least = int(tri.min())
    faces = tri - least
    used = torch.zeros(int(faces.max()) + 1, dtype=torch.bool).index_fill_(0, faces.reshape(-1), True)
    return torch.where(used, least + torch.arange(len(used)), tri[0, 0]), faces


class Frames:
    """Frames of one layer of one rasterize() call: one for all images; with ranges, one for those of alike sizes, and none
    for empty ranges. layers: as many surfaces as the layer's number, from 1 on."""

    def __init__(self, device, pos, tri, ranges, size, call, layers=1):
        self.device, self.tri, self.ranges, self.layers, self._size = device, tri, ranges, layers, size
        if ranges is None:
            frame = _Frame(device, pos, tri, torch.zeros(len(pos), dtype=torch.long), size, call, layers)
            self._parts = [_Part(list(range(len(pos))), None, frame)]
            return
        self._parts = []
        meshes = {image: _mesh_of(tri[first:first + count]) for image, (first, count) in enumerate(ranges) if count}
        sizes = {True: [], False: []}
        for image, (index, faces) in meshes.items():
            camera = _clip_space.camera_of(pos[None, index], None, size, "dpr.nvdiffrast." + call)
            sizes[camera.is_perspective].append((len(faces), len(index), image))
        pad = torch.nn.utils.rnn.pad_sequence
        for alike in filter(None, sizes.values()):
            for images in _merged.groups_by_size(alike, size[0] * size[1]):
                index = pad([meshes[image][0] - meshes[image][0][0] for image in images], True)
                index = index + torch.stack([meshes[image][0][0] for image in images])[:, None]
                faces = pad([meshes[image][1] for image in images], True)
                part = _Part(images, index)
                firsts = torch.tensor([ranges[image][0] for image in images])
                part.frame = _Frame(device, part.positions(pos), faces, firsts, size, call, layers)
                self._parts.append(part)

    def __reduce__(self):
        """Copies and pickles of rast have no frames, and are rasterized again."""
        return collections.OrderedDict, ()

    def _in_order(self, of_parts, others):
        """The parts' images, [N, H, W, C], in the order of their numbers, and those of the others where there is no part."""
        count = len(others)
        numbers = [image for part in self._parts for image in part.images]
        if numbers == list(range(count)):
            return torch.cat(of_parts) if len(of_parts) > 1 else of_parts[0]
        places = torch.tensor([numbers.index(i) if i in numbers else len(numbers) + i for i in range(count)])
        return torch.cat([*of_parts, others]).index_select(0, places)

    def rast(self, pos, grad_db):
        """([N, H, W, 4], [N, H, W, 4])"""
        empty = pos.new_zeros(len(pos) if self.ranges is None else len(self.ranges), *self._size, 4)
        found = [part.frame.rast(part.positions(pos), grad_db) for part in self._parts]
        return self._in_order([rast for rast, _ in found], empty), self._in_order([db for _, db in found], empty)

    def vertices_of(self, pos, tri):
        """Each part's vertices; None if any belongs to other positions."""
        if tri is not self.tri and not torch.equal(tri.long(), self.tri.long()):
            return None
        if (pos.ndim == 2) != (self.ranges is not None):
            return None
        found = [part.frame.vertices_of(part.positions(pos)) for part in self._parts]
        return None if any(own is None for own in found) else found

    def antialias(self, color, vertices, boost):
        colors = [color if len(part.images) == len(color) else color.index_select(0, torch.tensor(part.images))
                  for part in self._parts]
        found = [part.frame.antialias(*given, boost) for part, *given in zip(self._parts, colors, vertices)]
        return self._in_order(found, color)
