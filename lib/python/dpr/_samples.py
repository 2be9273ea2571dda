"""Shading of the caller's own, with noise on the pixel around it."""
from __future__ import annotations

import functools
import sys
from typing import Any, Callable, Dict, Optional, Tuple

import numpy as np

from . import _arrays, _library, _numpy, _rasterized
from ._rasterized import Rasterized, interpolated

Array = Any


def _kept(values, name="values"):
    return np.array(_arrays.to_numpy(_arrays.converted(name, _arrays.from_numbers(values), where="dpr.Samples")), np.float32)


class Samples:
    """What the samples of the rigid image show, for shading of the caller's own: see Renderer.rasterize().

    face_id        [N, h, w], int64: the layer's face, -1 where nothing is
    barycentrics   [N, h, w, 3] of that face's corners, with perspective; 0 where nothing is
    depth          [N, h, w] along the view direction, world units; 0 where nothing is. These three are of one layer: of
                   the nearest surfaces, unless this is one of `layers`
    supersampling  samples a pixel and axis; margin: samples around the image, so that h = height supersampling + 2 margin

    With PyTorch and JAX barycentrics, depth and what is made of them have derivatives by vertices, views and intrinsics, in
    reverse and forward mode; with other arrays pullback() and resolve_with_vjp() have them, and in forward mode jvp() and
    resolve_with_jvp(). A gradient goes back like this then:

        corners = colors[faces[samples.face_id.clip(0)]]  # [N, h, w, 3, C]
        image, resolved = samples.resolve_with_vjp((samples.barycentrics[..., None] * corners).sum(-2))  # interpolate()
        grad_values, by_contours = resolved(grad_image)
        inside = samples.pullback(barycentrics=(corners * grad_values[..., None, :]).sum(-1))
        gradient = by_contours["vertices"] + inside["vertices"]
    """

    supersampling: int
    margin: int

    def __init__(self, rasterized, read, plan, tensors, kind, layer=0):
        """read: finds [face_id, barycentrics, depth] of all layers, once; kind: the library of their arrays"""
        self._rasterized, self._read, self._plan, self._tensors, self._layer = rasterized, read, plan, tensors, layer
        self._kind, self._is_of_jax = kind, kind == "jax"
        self.supersampling, self.margin = rasterized.raster.supersampling, rasterized.raster.margin
        self._is_of_list = ("faces",) not in plan.paths
        # Of each mesh: numbers of vertices, and the faces' shape.
        self._meshes = list(zip([array.shape[-2] for array in _of_name(plan, plan.given, "vertices")],
                                [tuple(array.shape) for array in _of_name(plan, plan.given, "faces")]))

    @functools.cached_property
    def face_id(self) -> Array:
        return self._read()[0][self._layer]

    @functools.cached_property
    def barycentrics(self) -> Array:
        return self._read()[1][self._layer]

    @functools.cached_property
    def depth(self) -> Array:
        return self._read()[2][self._layer]

    @functools.cached_property
    def _faces(self):
        """[F, 3] or [N, F, 3] of the samples' library."""
        faces = _of_name(self._plan, self._plan.leaves, "faces")
        if self._is_of_jax:
            faces = [sys.modules["jax"].numpy.asarray(own) for own in faces]
        elif self._tensors is not None:
            faces = [sys.modules["torch"].as_tensor(own).long() for own in faces]
        return _arrays.padded(faces) if self._is_of_list else faces[0]

    @property
    def _size(self):
        """(N, h, w)"""
        return tuple(self.face_id.shape) if self._is_of_jax else self._rasterized.size

    @property
    def layers(self) -> Tuple[Samples, ...]:
        """Samples of each layer, the nearest first, as many as rasterize() was asked for."""
        return tuple(Samples(self._rasterized, self._read, self._plan, self._tensors, self._kind, layer)
                     for layer in range(self._rasterized.raster.layers))

    @property
    def mask(self) -> Array:
        """[N, h, w]: whether there is a face."""
        return self.face_id >= 0

    def interpolate(self, attributes: Array, faces: Optional[Array] = None, covered: bool = False) -> Array:
        """Attributes of vertices, [V, C] or [N, V, C], at the samples: [N, h, w, C], 0 where nothing is. faces: [F, 3], or
        [N, F, 3] as those of rasterize(), indices of the attributes for the corners of the mesh's faces, where they have
        some of their own. Of a list of meshes both are lists too. covered: only of the M samples where there is a face,
        [M, C] in the order of x[mask], so that a shader works on no others; resolve() takes its values so. Not within
        jax.jit(), which knows no M. Raises ValueError for other shapes and indices."""
        if not isinstance(covered, (bool, np.bool_)):
            _arrays.fail(TypeError, "covered", type(covered).__name__, "True or False", "dpr.Samples")
        attributes, own = self._tables_of(attributes, faces)
        if not covered:
            return self._interpolated(self.face_id, self.barycentrics, attributes, self._faces if own is None else own)
        if self._is_of_jax or self._layer > 0 or 0 in attributes.shape:
            return self._mixed_alone(own, attributes)
        if own is None and self._is_of_list:  # which the frame may have otherwise
            own = self._faces
        table = None if own is None else _arrays.to_numpy(own)
        if self._tensors is not None:
            from . import _interpolate
            mixed = functools.partial(self._mixed_alone, own)
            return _interpolate.interpolate_covered(self._rasterized, mixed, table, attributes, self._tensors)
        return _arrays.like(attributes, self._rasterized.interpolate(_arrays.to_numpy(attributes), table))

    def _mixed_alone(self, faces, attributes):
        """Attributes at the samples with a face, [M, C], by operations of the arrays' library."""
        found = self._interpolated(*self._covered_alone(attributes, self._faces if faces is None else faces))
        return found.reshape(found.shape[-2:])

    def _interpolated(self, face_id, barycentrics, attributes, faces):
        mixed = functools.partial(self._mixed, face_id)
        if not self._is_of_jax and 0 not in (*face_id.shape, *faces.shape, *attributes.shape[-2:]):
            if self._tensors is not None:
                from . import _interpolate
                return _interpolate.interpolate(face_id, barycentrics, attributes, faces, mixed)
            if isinstance(attributes, np.ndarray):
                return interpolated(face_id, barycentrics, attributes, faces)
        return mixed(barycentrics, attributes, faces)

    def _mixed(self, face_id, barycentrics, attributes, faces):
        return (barycentrics[..., None] * self._at_corners(face_id, attributes, faces)).sum(-2)

    @functools.cached_property
    def _covered(self):
        """Places of the samples with a face, among all views' samples."""
        if self._is_of_jax and isinstance(self.face_id, sys.modules["jax"].core.Tracer):
            _arrays.fail(ValueError, "covered samples", "a call within jax.jit() or jax.vmap()", "one outside: their number "
                         "is not known there", "dpr.Samples")
        face_id = self.face_id if self._is_of_jax else self._rasterized.outputs[0][self._layer]
        return np.flatnonzero(np.asarray(face_id) >= 0)

    def _covered_alone(self, attributes, faces):
        """face_id and barycentrics [1, 1, M, ...] of the samples with a face, and tables of all views' vertices and faces."""
        count, h, w = self._size
        ids, barycentrics = (_arrays.rows(array.reshape(count * h * w, *array.shape[3:]), self._covered)[None, None]
                             for array in (self.face_id, self.barycentrics))
        if attributes.ndim == 3 or faces.ndim == 3:
            ids = ids + _arrays.like(ids, self._covered // (h * w) * faces.shape[-2])
            step = attributes.shape[1] if attributes.ndim == 3 and len(attributes) > 1 else 0
            faces = faces.clip(0) + _arrays.like(faces, step * np.arange(count)[:, None, None])
            attributes, faces = attributes.reshape(-1, attributes.shape[-1]), faces.reshape(-1, 3)
        return ids, barycentrics, attributes, faces

    def interpolate_steps(self, attributes: Array, faces: Optional[Array] = None) -> Array:
        """How fast interpolate(attributes, faces) changes from sample to sample to the right and down, [N, h, w, C, 2]: of
        texture coordinates, `steps` of texture(). The samples' places on their faces count as constant. Not of JAX."""
        if self._is_of_jax:
            _arrays.fail(TypeError, "interpolate_steps()", "samples of JAX", "those of other arrays", "dpr.Samples")
        steps = _arrays.like(self.depth, self._rasterized.steps[self._layer])
        attributes, faces = self._tables_of(attributes, faces)
        corners = self._at_corners(self.face_id, attributes, self._faces if faces is None else faces)
        return (steps[..., None, :] * corners[..., None]).sum(-3)

    def _tables_of(self, attributes, faces):
        """What was given as attributes [V, C] or [N, V, C], and faces or None."""
        attributes, faces = _arrays.from_numbers(attributes), _arrays.from_numbers(faces, True)
        if isinstance(attributes, (list, tuple)) and self._is_of_list:
            attributes, faces = self._tables(attributes, faces)
        else:
            counts = {vertices for vertices, _ in self._meshes}
            if len(counts) > 1 and faces is None and len(getattr(attributes, "shape", ())) == 2:
                _arrays.fail(ValueError, "attributes", list(attributes.shape), f"a list of {len(self._meshes)}", "dpr.Samples")
            shape = tuple(self._faces.shape) if self._is_of_list else self._meshes[0][1]
            attributes, faces = self._table("", attributes, faces, max(counts), shape)
        if faces is not None and self._tensors is not None and not self._is_of_jax:
            faces = sys.modules["torch"].as_tensor(faces).long()
        return attributes, faces

    def _at_corners(self, face_id, attributes, faces):
        """[N, h, w, 3, C], or what broadcasts to it: attributes of the corners of the samples' faces."""
        if 0 in (*faces.shape, attributes.shape[-2]):
            return attributes.sum(-2)[..., None, None, None, :]  # there is nothing
        meshes = np.arange(len(faces))[:, None, None]
        corners = faces[meshes, face_id.clip(0)] if faces.ndim == 3 else faces[face_id.clip(0)]
        return attributes[corners] if attributes.ndim == 2 else \
            attributes[np.arange(len(attributes))[:, None, None, None], corners]

    def _table(self, which, attributes, faces, vertices, shape_of_faces):
        """Attributes and faces, or None, that fit so many vertices, and a mesh's faces; `which` of a list."""
        attributes = self._of_my_kind("attributes" + which, attributes)
        rows, least = vertices, 0
        if faces is not None:
            faces = _arrays.converted("faces" + which, _arrays.from_numbers(faces, True), True, "dpr.Samples")
            if tuple(faces.shape) != shape_of_faces:
                _arrays.fail(ValueError, "faces" + which, list(faces.shape), list(shape_of_faces), "dpr.Samples")
            bounds = faces.clip(0) if faces.ndim == 3 else faces
            rows, least = (int(bounds.max()) + 1, int(bounds.min())) if 0 not in shape_of_faces else (0, 0)
        shape, count = tuple(attributes.shape), self._size[0]
        is_table = len(shape) == 2 or len(shape) == 3 and shape[0] in (1, count) and not which
        if not is_table or least < 0 or shape[-2] < rows or faces is None and shape[-2] != rows:
            wanted = str(rows) if faces is None else f"rows for indices from {least} to {rows - 1}"
            shapes = "[V, C]" if which else f"[V, C] or [{count}, V, C]"
            _arrays.fail(ValueError, "attributes" + which, list(shape), f"{shapes}, V: {wanted}", "dpr.Samples")
        return attributes, faces

    def _tables(self, attributes, faces):
        """The same of lists of meshes, as one array each."""
        count = len(self._meshes)
        given = {"attributes": attributes, "faces": [None] * count if faces is None else faces}
        for name, arrays in given.items():
            if not isinstance(arrays, (list, tuple)) or len(arrays) != count:
                got = f"{len(arrays)} meshes" if isinstance(arrays, (list, tuple)) else type(arrays).__name__
                _arrays.fail(ValueError, name, got, f"a list of {count}, as those of rasterize()", "dpr.Samples")
        tables, indices = zip(*(self._table(f"[{i}]", *own, *mesh)
                                for i, (*own, mesh) in enumerate(zip(*given.values(), self._meshes))))
        for i, table in enumerate(tables):
            if table.shape[1] != tables[0].shape[1]:
                _arrays.fail(ValueError, f"attributes[{i}]", list(table.shape), f"[V, {tables[0].shape[1]}]", "dpr.Samples")
        return _arrays.padded(tables), None if faces is None else _arrays.padded(indices)

    def _require_numpy(self, function):
        if self._is_of_jax:
            _arrays.fail(TypeError, function, "samples of JAX", "jax.vjp() and jax.jvp() of resolve()", "dpr.Samples")

    def _of_my_kind(self, name, array):
        """Floats, as tensors if the samples are. Fails for a tensor whose gradient would be lost."""
        array = _arrays.converted(name, _arrays.from_numbers(array), where="dpr.Samples")
        if self._is_of_jax:
            return sys.modules["jax"].numpy.asarray(array)
        if self._tensors is not None:
            return array if _arrays.module_of(array) == "torch" else sys.modules["torch"].from_dlpack(_arrays.to_numpy(array))
        if getattr(array, "requires_grad", False):
            _arrays.fail(ValueError, name, "a tensor that requires a gradient", "an array without, as rasterize() was given no "
                         "tensors: resolve_with_vjp() and pullback() have gradients", "dpr.Samples")
        return _arrays.to_numpy(array) if self._kind == "numpy" else array

    def resolve(self, values: Array) -> Array:
        """Images [N, height, width, C] of values of the samples, [N, h, w, C] with any number of channels: blended across
        contours and blurred, as the library makes images of its own colours. Samples where nothing is need a value too:
        the background's; of values [M, C] of the samples with a face, as interpolate(covered=True) has them, it is 0, and a
        channel of ones becomes alpha, which wants clamping. Contours count that fewer surfaces hide than there are layers:
        whichever layer's resolve() is called. Beside contours samples are continued, so that images may leave the values'
        range. Raises ValueError for another shape, and what is not finite."""
        values = self._for_frame(self._of_my_kind("values", values))
        if self._is_of_jax:
            from . import _jax
            return _jax.resolve(self._rasterized, values, self._tensors)
        if self._tensors is not None:
            from . import _torch
            return _torch.resolve(self._rasterized, values, self._tensors)
        return _arrays.like(values, self._rasterized.resolve(_arrays.to_numpy(values)))

    def _for_frame(self, values):
        """Values of all samples, 0 where nothing is, of those of the samples with a face; the library takes the nearest
        layer's as they are."""
        if values.ndim != 2 or not self._is_of_jax and self._layer == 0:
            return values
        if len(values) != len(self._covered) or values.shape[-1] == 0:
            _arrays.fail(ValueError, "values", list(values.shape), _rasterized.shapes_of_values(self._size, len(self._covered)),
                         "dpr.Samples")
        return _arrays.spread(values, self._covered, int(np.prod(self._size))).reshape(*self._size, values.shape[-1])

    def resolve_with_vjp(self, values: Array) -> Tuple[Array, Callable[[Array], Tuple[Array, Dict[str, Array]]]]:
        """(resolve(values), pullback). pullback(grad_images) returns the gradient of the values and, by way of the
        contours, those of vertices, views and intrinsics, by name; of tensors, of those that required a gradient."""
        self._require_numpy("resolve_with_vjp()")
        given = _kept(values)
        kept = self._for_frame(given)

        def pullback(grad_images):
            grad_values, found = self._rasterized.resolve_gradients(kept, grad_images)
            if grad_values.ndim > given.ndim:
                grad_values = _arrays.rows(grad_values.reshape(-1, given.shape[-1]), self._covered)
            return _arrays.like(values, grad_values), self._by_name(found)

        return _arrays.like(values, self._rasterized.resolve(kept)), pullback

    def pullback(self, barycentrics: Optional[Array] = None, depth: Optional[Array] = None) -> Dict[str, Array]:
        """Gradients of vertices (of a list of meshes a list), views and intrinsics, by name, from those of barycentrics and
        depth. They leave out how contours move, which resolve_with_vjp() has: add up both, and those of other layers. Of
        tensors, those that required a gradient when rasterize() was called have one."""
        self._require_numpy("pullback()")
        if not self._rasterized.leaves:
            _arrays.fail(ValueError, "pullback()", "samples of tensors without gradients", "a tensor that requires one",
                         "dpr.Samples")
        return self._by_name(self._rasterized.gradients_of_layer(self._layer, (None, barycentrics, depth)))

    def jvp(self, tangents: Dict[str, Array]) -> Tuple[Array, Array]:
        """Tangents of barycentrics [K, N, h, w, 3] and depth [K, N, h, w] along K directions at once: forward mode.

        tangents: by "vertices", "views" and "intrinsics", how fast each number changes, [K, *the argument's shape], of a list
        a list; of tensors, of those that required a gradient when rasterize() was called. PyTorch takes its own by
        torch.func.jvp and torch.autograd.forward_ad, from 2.0 on, and JAX by jax.jvp. The tangent of interpolate(attributes)
        is interpolate(those of the attributes), plus the attributes of the faces' corners times those of the barycentrics."""
        self._require_numpy("jvp()")
        _, given = self._moving(tangents)
        found = self._rasterized.tangents(given)
        return tuple(_arrays.like(self._plan.given[0], tangent[:, self._layer]) for tangent in found)

    def resolve_with_jvp(self, values: Array, value_tangents: Optional[Array] = None,
                         tangents: Optional[Dict[str, Array]] = None) -> Tuple[Array, Array]:
        """(resolve(values), its tangents [K, N, height, width, C]) along K directions, in which the values change by
        value_tangents [K, *values.shape], and by way of the contours, vertices, views and intrinsics by `tangents` as
        jvp() takes them; of both, those left out stay."""
        self._require_numpy("resolve_with_jvp()")
        own = _kept(values)
        kept = self._for_frame(own)
        if value_tangents is not None:
            value_tangents = _kept(value_tangents, "tangents of values")
            if value_tangents.shape[1:] != own.shape or len(value_tangents) == 0:
                _arrays.fail(ValueError, "tangents of values", list(value_tangents.shape),
                             f"[K, {', '.join(map(str, own.shape))}]", "dpr.Samples")
            value_tangents = np.stack([self._for_frame(moved) for moved in value_tangents])
        if value_tangents is None and tangents is None:
            _arrays.fail(ValueError, "tangents", "none", "those of the values, or of one array at least", "dpr.Samples")
        count, given = (len(value_tangents), {}) if tangents is None else self._moving(tangents)
        found = self._rasterized.resolve_tangents(count, kept, value_tangents, given)
        return _arrays.like(values, self._rasterized.resolve(kept)), _arrays.like(values, found)

    def _moving(self, tangents):
        """(K, {leaf: tangents})"""
        given = _numpy.tangents_of_leaves(self._plan, tangents)
        for leaf in given:
            if leaf not in self._rasterized.leaves:
                _arrays.fail(ValueError, f"tangents of {self._plan.paths[leaf][0]}", "some", "none: the tensor required no "
                             "gradient when rasterize() was called", "dpr.Samples")
        return len(next(iter(given.values()))), given

    def _by_name(self, found):
        return _numpy.nested(self._plan, found)


def _of_name(plan, arrays, name):
    """Arrays of an argument, among a plan's: one, or as many as there are meshes in a list."""
    return [array for path, array in zip(plan.paths, arrays) if path[0] == name]


def colors_of_parts(parts, faces):
    """Colours of faces by which the library finds the edges between parts; None without."""
    if parts is None:
        return None
    faces = _arrays.from_numbers(faces, True)
    is_list = isinstance(faces, (list, tuple))
    own, of = (parts if isinstance(parts, (list, tuple)) else [parts], faces) if is_list else ([parts], [faces])
    if len(own) != len(of):
        _arrays.fail(ValueError, "parts", f"{len(own)} meshes", f"a list of {len(of)}, as faces are")
    found = []
    for i, (numbers, mesh) in enumerate(zip(own, of)):
        name = f"parts[{i}]" if is_list else "parts"
        numbers = _arrays.converted(name, _arrays.from_numbers(numbers, True), True)
        mesh = _arrays.converted("faces", _arrays.from_numbers(mesh, True), True)
        if tuple(numbers.shape) != tuple(mesh.shape[:-1]):
            _arrays.fail(ValueError, name, list(numbers.shape), list(mesh.shape[:-1]))
        numbers = np.unique(_arrays.to_numpy(numbers), return_inverse=True)[1].reshape(numbers.shape)
        found.append(np.repeat(numbers[..., None].astype(np.float32), 3, -1))
    return found if is_list else found[0]


def rasterize(spec, plan, copy):
    """Samples of a call's meshes, of whose faces they have their own: those that are given may change in place."""
    leaves, tensors = plan.leaves, None
    for number, (path, leaf) in enumerate(zip(plan.paths, leaves)):
        if path[0] == "faces":
            leaves[number] = _arrays.copied(leaf)
    kinds = {_arrays.module_of(leaf) for leaf in leaves}
    kind = next((name for name in ("torch", "jax") if name in kinds), _arrays.module_of(plan.given[0]))
    if kind == "torch":
        from . import _torch
        rasterized, read, tensors = _torch.rasterize(spec, leaves, copy)
    elif kind == "jax":
        from . import _jax
        rasterized, outputs, tensors = _jax.rasterize(spec, leaves)
        read = functools.partial(tuple, outputs)
    else:
        wanted = [i for i, path in enumerate(plan.paths) if path[0] in ("vertices", "views", "intrinsics")]
        rasterized = Rasterized(spec, [_arrays.to_numpy(leaf) for leaf in leaves], wanted)
        read = functools.lru_cache(None)(lambda: [_arrays.like(plan.given[0], output) for output in rasterized.outputs])
    if rasterized.warning:
        _library.warn(rasterized.warning)
    return Samples(rasterized, read, plan, tensors, kind)
