"""Samples of positions in clip space, for the operations of nvdiffrast."""
import collections

import numpy as np
import torch

from . import _arrays, _clip_space, _merged, _rows, _torch
from ._rasterized import Rasterized
from ._renderer import Renderer

_SHARP = {"preset": "pixel", "sigma": 1e-12, "gamma": 1e-9}
"""Blends samples across contours over one pixel without a further blur. Only the nearest surface is visible."""


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
        spec, plan = renderer._plan_samples(self.vertices, faces, *views_and_intrinsics, layers)
        self._tensors = [torch.as_tensor(leaf) for leaf in plan.leaves]
        wanted = [i for i, tensor in enumerate(self._tensors) if tensor.requires_grad]
        self._rasterized = Rasterized(spec, [_arrays.to_numpy(tensor) for tensor in self._tensors], wanted)

    def _placed(self, pos):
        used = torch.full((pos.shape[1],), self.faces.ndim == 3)
        if self.faces.ndim == 2:
            used[self.faces.long().reshape(-1)] = True
        faces = self.faces if self.faces.ndim == 2 else None
        camera = _clip_space.camera_of(pos, faces, (self._height, self._width), "dpr.nvdiffrast." + self._call)
        return camera, camera.vertices(pos, used, self._width, self._height)

    def rast(self, pos, grad_db):
        """([N, H, W, 4], [N, H, W, 4])"""
        return _Rast.apply(self, grad_db, pos, *self._tensors)

    def find(self, pos):
        """As NumPy's arrays, of NumPy's."""
        firsts = np.broadcast_to(np.asarray(self.firsts, np.int64), len(pos))
        return self._rasterized.clip_space_rast(*map(np.ascontiguousarray, (pos, _arrays.to_numpy(self.faces), firsts)))

    def _inner(self, samples):
        margin = self._rasterized.raster.margin
        return samples[:, margin:margin + self._height, margin:margin + self._width]

    def gradients(self, pos, rast, grad_rast, grad_db):
        """(gradient of pos, if it has one by itself, [those of the frame's tensors])"""
        raster, of_pos, shown = self._rasterized.raster, None, rast[..., 3] > 0  # others are constant
        grad = rast.new_zeros(len(pos), raster.height, raster.width, 3)
        inner = self._inner(grad)
        if self._camera.is_perspective and grad_db is None:
            torch.where(shown[..., None], grad_rast[..., :2], rast.new_zeros(()), out=inner[..., :2])
        else:
            covered = shown.reshape(-1).nonzero()[:, 0]
            of_pos, of_weights = self._gradients_at(pos, covered, grad_rast, grad_db)
            inner += _arrays.spread(of_weights, covered, rast[..., 0].numel()).reshape(inner.shape)
        found = self._rasterized.gradients_of_layer(raster.layers - 1, (None, grad, None))
        return of_pos, [torch.from_numpy(found[i]) if i in found else None for i in range(len(self._tensors))]

    def _gradients_at(self, pos, covered, grad_rast, grad_db):
        """Gradients of pos, apart from its part in the samples, and of their weights [K, 3], at covered pixels [K]."""
        inner = [self._inner(torch.from_numpy(output[-1])) for output in self._rasterized.outputs[:2]]
        face_id, barycentrics = (output.reshape(-1, *output.shape[3:])[covered] for output in inner)
        shape = covered.div(self._height * self._width, rounding_mode="floor")
        place = face_id + shape * self.faces.shape[-2]
        faces = self.faces.long().reshape(-1, 3).index_select(0, place if self.faces.ndim == 3 else face_id)
        corners = [corner.contiguous() for corner in (faces + (shape * pos.shape[1])[:, None]).unbind(1)]
        with torch.enable_grad():
            pos, barycentrics = pos.detach().requires_grad_(), barycentrics.requires_grad_()
            weights = barycentrics
            if not self._camera.is_perspective:  # whose weights are linear on the screen
                of_w = pos[..., 3].reshape(-1)
                weights = weights / torch.stack([of_w.index_select(0, corner) for corner in corners], 1)
                weights = weights / weights.sum(1, keepdim=True)
            found = [(weights[:, :2], grad_rast, 2), (self._derivatives(pos, weights, corners, place), grad_db, 4)]
            outputs, grads = zip(*((own, grad.reshape(-1, 4).index_select(0, covered)[:, :count])
                                   for own, grad, count in found if grad is not None))
            return torch.autograd.grad(outputs, (pos, barycentrics), grads, allow_unused=True)

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
        if pos.shape[:2] != self.vertices.shape[:2] or is_wanted and not self.vertices.requires_grad:
            return None
        vertices = self._placed(pos)[1]
        return vertices if torch.equal(vertices, self.vertices) else None

    def antialias(self, color, vertices, boost):
        margin = self._rasterized.raster.margin
        if boost != 1:
            vertices = vertices.detach() + boost * (vertices - vertices.detach())
        tensors = [vertices if tensor is self.vertices else tensor for tensor in self._tensors]
        around = torch.nn.functional.pad(color.permute(0, 3, 1, 2), (margin,) * 4, mode="replicate").permute(0, 2, 3, 1)
        return _torch.resolve(self._rasterized, around, tensors)


def _slopes(corners):
    """[R, 6] of corners [R, 3, 4] in clip space: d/dX and d/dY in NDC of u / w, v / w and 1 / w."""
    places = corners[..., (0, 1, 3)].double()
    lines = torch.cross(places.roll(-1, 1), places.roll(-2, 1), dim=-1)
    area = (lines[:, 0] * places[:, 0]).sum(1)
    slopes = lines[..., :2] / torch.where(area == 0, torch.ones_like(area), area)[:, None, None]
    return torch.cat([slopes[:, 0], slopes[:, 1], slopes.sum(1)], 1).to(corners.dtype)


class _Rast(torch.autograd.Function):
    """(frame, whether rast_db has gradients, pos [N, V, 4], the frame's tensors) to rast and rast_db."""

    @staticmethod
    def forward(ctx, frame, grad_db, pos, *tensors):
        rast, rast_db = map(torch.from_numpy, frame.find(_arrays.to_numpy(pos)))
        ctx.frame = frame
        ctx.save_for_backward(pos, rast, *tensors)
        ctx.set_materialize_grads(False)
        if not grad_db:
            ctx.mark_non_differentiable(rast_db)
        return rast, rast_db

    @staticmethod
    def backward(ctx, grad_rast, grad_db):
        if grad_rast is None and grad_db is None:
            return (None,) * (1 + len(ctx.saved_tensors))
        return (None, None, *_RastGradients.apply(ctx.frame, grad_rast, grad_db, *ctx.saved_tensors))


@_torch.one_forward
class _RastGradients(_torch.Derivative):
    """(frame, gradients of rast and rast_db, or None, pos, rast, the frame's tensors) to gradients of pos and these."""

    @staticmethod
    def forward(frame, grad_rast, grad_db, pos, rast, *_):
        of_pos, found = frame.gradients(pos, rast, grad_rast, grad_db)
        return (of_pos, *found)


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
        tri = tri.clone()  # which may change in place
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
        empty = pos.new_zeros(()).expand(len(pos) if self.ranges is None else len(self.ranges), *self._size, 4)
        found = [part.frame.rast(part.positions(pos), grad_db) for part in self._parts]
        return self._in_order([rast for rast, _ in found], empty), self._in_order([db for _, db in found], empty)

    def vertices_of(self, pos, tri):
        """Each part's vertices; None if any belongs to other positions, or triangles."""
        if not torch.equal(tri.to(self.tri.dtype), self.tri):
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
