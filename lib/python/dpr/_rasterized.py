"""Frames for shading of the caller's own: what their samples show, and images of values that the caller finds for them."""
from __future__ import annotations

import ctypes
import functools

import numpy as np

from . import _arrays, _frames, _library, _merged

_NAMES = ("face_id", "barycentrics", "depth")
_KEPT_CHANNELS = 4  # of values that the library keeps for the pass back


class Rasterized:
    """A frame, and what its samples show."""

    @_arrays.named("dpr.rasterize")
    def __init__(self, spec, arrays, wanted):
        """arrays, wanted: as Rendered has them."""
        arrays = [np.ascontiguousarray(array).reshape(array.shape) for array in arrays]
        self.leaves, self._shapes, self._resolved = wanted, [array.shape for array in arrays], None
        self._lot, self._frame = _rendered(spec, arrays, wanted)
        # Of a frame that shows nothing.
        self.warning = _frames.NOTHING_RENDERED if self._frame.is_empty() else None
        self.raster = _library.Raster()
        _library.call("dpr_frame_raster", self._frame.handle, ctypes.byref(self.raster))
        count = len(dict(self._lot.named)["views"])
        self.size, self._image_size = (count, self.raster.height, self.raster.width), (count, spec.height, spec.width)

    @functools.cached_property
    def steps(self):
        """[layer, view, h, w, 3, 2]: how fast barycentrics change from sample to sample to the right and down."""
        found = np.empty((self.raster.layers, *self.size, 2, 2), np.float32)
        _library.call("dpr_frame_samples", self._frame.handle,
                      *_of_layers([("barycentric_steps", found.reshape(*found.shape[:4], 4))]))
        return np.concatenate([-found.sum(-2, keepdims=True), found], -2)

    @property
    def _output_shapes(self):
        size = (self.raster.layers, *self.size)
        return size, (*size, 3), size

    @functools.cached_property
    def outputs(self):
        """[face_id, barycentrics, depth], each [layer, view, ...]"""
        found = [np.empty(shape, kind) for shape, kind in zip(self._output_shapes, (np.int64, np.float32, np.float32))]
        _library.call("dpr_frame_samples", self._frame.handle, *_of_layers(zip(_NAMES, found)))
        return found

    @_arrays.named("dpr.nvdiffrast.rasterize")
    def clip_space_rast(self, positions, faces, firsts):
        """What nvdiffrast's rasterize() returns of the last layer; arguments as dpr_clip_space_rast() has them."""
        arrays = [("positions", positions), ("faces", faces), ("firsts", firsts)]
        found = [(name, np.empty((*self._image_size, 4), np.float32)) for name in ("rast", "rast_db")]
        _library.call("dpr_clip_space_rast", self._frame.handle, *_frames.c_arrays(arrays), *_frames.c_arrays(found))
        return [array for _, array in found]

    def _gradients(self, function, *arguments):
        """{leaf: gradient} that a function of the library computes."""
        totals = {leaf: np.zeros(self._shapes[leaf], np.float32) for leaf in self.leaves}
        found = self._lot.gradients(totals)
        _library.call(function, self._frame.handle, *arguments, *_frames.c_arrays(found))
        self._lot.add(found, totals)
        return totals

    def gradients(self, grads):
        """{leaf: gradient} of sum <grad, output>, of the outputs whose grad is not None."""
        named = [(name, np.ascontiguousarray(_arrays.to_numpy(grad), np.float32)) for name, grad in zip(_NAMES, grads)
                 if grad is not None]
        return self._gradients("dpr_frame_samples_backward", *_of_layers(named))

    def gradients_of_layer(self, layer, grads):
        """The same by the outputs of one layer."""
        whole = [None if grad is None else np.zeros(shape, np.float32) for grad, shape in zip(grads, self._output_shapes)]
        for name, grad, of_all in zip(_NAMES, grads, whole):
            if grad is not None:
                of_all[layer] = _checked(name, grad, of_all.shape[1:])
        return self.gradients(whole)

    @functools.cached_property
    def covered_count(self):
        """Samples of the nearest layer with a face."""
        count = ctypes.c_size_t()
        _library.call("dpr_frame_covered", self._frame.handle, ctypes.byref(count))
        return count.value

    @_arrays.named("dpr.Samples")
    def interpolate(self, attributes, faces):
        """[M, C] at these samples. faces: None for those of the mesh."""
        values = np.empty((self.covered_count, attributes.shape[-1]), np.float32)
        _library.call("dpr_frame_interpolate", self._frame.handle, *_frames.c_arrays(_table(attributes, faces)),
                      _one("values", values))
        return values

    def interpolate_gradients(self, attributes, faces, grad):
        """(gradient of the attributes, {leaf: gradient})"""
        table, grad = _table(attributes, faces), np.ascontiguousarray(grad)
        grad_attributes = np.empty(table[0][1].shape, np.float32)
        found = self._gradients("dpr_frame_interpolate_backward", *_frames.c_arrays(table), _one("grad_values", grad),
                                _one("grad_attributes", grad_attributes))
        return grad_attributes.reshape(attributes.shape), found

    def resolve(self, values):
        values = self._checked_values(values)
        images = np.empty((*self._image_size, values.shape[-1]), np.float32)
        _library.call("dpr_frame_resolve", self._frame.handle, _one("values", values), _one("images", images))
        self._resolved = values if values.shape[-1] <= _KEPT_CHANNELS else None
        return images

    def resolve_gradients(self, values, grad_images):
        """(gradient of the values, {leaf: gradient})"""
        values = self._checked_values(values)
        grad_images = _checked("gradient of the images", grad_images, (*self._image_size, values.shape[-1]))
        grad_values = np.empty(values.shape, np.float32)
        is_kept = self._resolved is not None and values.ctypes.data == self._resolved.ctypes.data and \
            values.shape == self._resolved.shape
        if not is_kept:
            self._resolved = None
        found = self._gradients("dpr_frame_resolve_backward", None if is_kept else _one("values", values),
                                _one("grad_images", grad_images), _one("grad_values", grad_values))
        return grad_values, found

    def _checked_values(self, values):
        """Packed floats of all samples, or of those with a face. Fails for another shape."""
        if values.ndim == 2 and (len(values) != self.covered_count or values.shape[-1] == 0):
            _arrays.fail(ValueError, "values", list(values.shape), shapes_of_values(self.size, self.covered_count), "dpr.Samples")
        if values.ndim == 2:
            return np.ascontiguousarray(_arrays.to_numpy(values), np.float32)
        return _checked("values", values, (*self.size, values.shape[-1] if values.ndim == 4 else 0))

    def of_all(self, values):
        """Values [..., N, h, w, C] of those of the samples with a face, [..., M, C]; 0 where nothing is."""
        found = np.zeros((*values.shape[:-2], int(np.prod(self.size)), values.shape[-1]), np.float32)
        found[..., np.flatnonzero(self.outputs[0][0] >= 0), :] = values
        return found.reshape(*values.shape[:-2], *self.size, values.shape[-1])

    def tangents(self, given):
        """Tangents [K, *output.shape] of barycentrics and depth along {leaf: [K, ...]} of arrays that were wanted."""
        count = len(next(iter(given.values())))
        found = [np.empty((count, *shape), np.float32) for shape in self._output_shapes[1:]]
        rows = [(name, array.reshape(-1, *array.shape[3:])) for name, array in zip(_NAMES[1:], found)]
        moving, self._resolved = self._moving(count, given), None  # the frame may be rendered again
        _library.call("dpr_frame_samples_tangent", self._frame.handle, count, *_frames.c_arrays(moving),
                      *_frames.c_arrays(rows))
        return found

    def resolve_tangents(self, count, values, value_tangents, given):
        """Tangents [count, N, height, width, C] of resolve(values), along {leaf: [count, ...]} of arrays that were wanted.
        value_tangents: [count, *values.shape], or None where the values stay."""
        values = self._checked_values(values)
        moved = np.zeros((count, *values.shape), np.float32) if value_tangents is None else \
            _checked("tangents of values", value_tangents, (count, *values.shape), is_empty=True)
        if values.ndim == 2:
            values, moved = self.of_all(values), self.of_all(moved)
        self._resolved = None
        images = np.empty((count, *self._image_size, values.shape[-1]), np.float32)
        moving = self._moving(count, given)
        _library.call("dpr_frame_resolve_tangent", self._frame.handle, count, *_frames.c_arrays(moving),
                      _one("values", values), _one("value_tangents", moved.reshape(-1, *values.shape[1:])),
                      _one("images", images.reshape(-1, *images.shape[2:])))
        return images

    def _moving(self, count, given):
        """The frame's arrays of tangents."""
        return self._lot.tangents({leaf: np.ascontiguousarray(tangent, np.float32) for leaf, tangent in given.items()}, count)


@functools.lru_cache(maxsize=64)
def raster_of(spec):
    """The raster of a spec's samples."""
    camera = [("views", np.eye(4, dtype=np.float32)[None]), ("intrinsics", np.ones((1, 4), np.float32))]
    frame = _frames.Frame(_frames.options_of(spec), [*camera, *_merged.NO_MESH.items()])
    raster = _library.Raster()
    _library.call("dpr_frame_raster", frame.handle, ctypes.byref(raster))
    return raster


def _rendered(spec, arrays, wanted):
    """(arrays of one frame, the frame) of all the call's meshes."""
    def framed(lot, view=None):
        return _frames.Frame(_frames.options_of(spec, lot.settings, 0, lot.names(wanted), True), lot.named, view)

    frames = _frames.frames_of(spec.parts)
    alone = [_merged.Single(*frame, arrays, True) for frame in frames]
    for mesh in alone:
        mesh.named = _unpadded({**_merged.NO_MESH, **dict(mesh.named)})
    if len(alone) == 1:
        return alone[0], framed(alone[0])
    for view, mesh in enumerate(alone):
        if not _merged.is_regular(dict(mesh.named)):
            framed(mesh, view)  # is refused
    lot = _merged.Merged(frames, arrays)
    try:
        return lot, framed(lot)
    except _library.InvalidArgument:
        for view, mesh in enumerate(alone):  # by itself each says what is wrong
            framed(mesh, view)
        raise


def _unpadded(arrays):
    """(name, array) pairs in which meshes of a batch, faces [N, F, 3], are padded as frames take them: with faces of one
    vertex, and vertices at the place of the first one."""
    faces = arrays["faces"]
    if faces.ndim < 3:
        return list(arrays.items())
    _merged.require_padding(faces)
    arrays = {**arrays, "faces": faces.clip(0)}
    if arrays["vertices"].ndim < 3 or len(arrays["vertices"]) != len(faces):
        return list(arrays.items())  # is refused
    is_there = np.arange(arrays["vertices"].shape[-2]) <= faces.max((1, 2))[:, None]
    first = np.take_along_axis(arrays["vertices"], faces.clip(0)[:, :1, :1], 1)
    vertices = np.where(is_there[..., None], arrays["vertices"], first)
    return list({**arrays, "vertices": vertices}.items())


def _of_layers(named):
    """(name, packed array [layer, view, ...]) pairs as (dpr_array[], count): the layers' views are one after the other."""
    return _frames.c_arrays([(name, array.reshape(-1, *array.shape[2:])) for name, array in named])


def _one(name, array):
    return _frames.c_arrays([(name, array)])[0]


def shapes_of_values(size, covered):
    """Those of samples' values, in words."""
    return f"{[*size, 'C']}, or [{covered}, C] of the samples with a face".replace("'", "")


def _table(attributes, faces):
    """Attributes [V, C] or [N, V, C], and faces [F, 3] or [N, F, 3] or None, as the library takes them."""
    arrays = [("attributes", attributes)] + ([] if faces is None else [("faces", faces.clip(0))])
    return [(name, np.ascontiguousarray(array[0] if array.ndim == 3 and len(array) == 1 else array)) for name, array in arrays]


def _checked(name, array, shape, is_empty=False):
    """Packed floats. Fails for another shape."""
    array = _arrays.from_numbers(array)
    _arrays.require_array(name, array, "dpr.Samples")
    array = np.ascontiguousarray(_arrays.to_numpy(array), np.float32)
    if array.shape != shape or not (array.size or is_empty):
        _arrays.fail(ValueError, name, list(array.shape), f"[{', '.join(str(size or 'C') for size in shape)}]", "dpr.Samples")
    return array


def _at_samples(samples, attributes, faces):
    """A table and what is interpolated by it, as the library has them. samples: {name: array}"""
    return [(name, np.ascontiguousarray(array)) for name, array in samples.items()] + _table(attributes, faces)


def interpolated_at(samples, attributes, faces, outputs):
    """{name: array} of "values" and "steps". samples: {name: array}, as dpr_interpolate() takes them."""
    named = _at_samples(samples, attributes, faces)
    size, channels = next(iter(samples.values())).shape[:3], attributes.shape[-1]
    found = {name: np.empty((*size, channels * (2 if name == "steps" else 1)), np.float32) for name in outputs}
    _library.call("dpr_interpolate", *_frames.c_arrays(named), *_frames.c_arrays(list(found.items())))
    return found


def interpolated_gradients_at(samples, attributes, faces, grads):
    """{name: array} of the samples' floats and the attributes. grads: {name: array} of the outputs."""
    named, grads = _at_samples(samples, attributes, faces), {name: np.ascontiguousarray(grad) for name, grad in grads.items()}
    found = {name: np.empty(array.shape, np.float32) for name, array in named if name not in ("face_id", "faces")}
    _library.call("dpr_interpolate_backward", *_frames.c_arrays(named), *_frames.c_arrays(list(grads.items())),
                  *_frames.c_arrays(list(found.items())))
    return {**found, "attributes": found["attributes"].reshape(attributes.shape)}


@_arrays.named("dpr.Samples")
def interpolated(face_id, barycentrics, attributes, faces):
    """Attributes at samples of one layer, [N, h, w, C]; 0 where nothing is."""
    return interpolated_at({"face_id": face_id, "barycentrics": barycentrics}, attributes, faces, ["values"])["values"]


def interpolated_gradients(face_id, barycentrics, attributes, faces, grad):
    """(those of barycentrics, those of attributes)"""
    found = interpolated_gradients_at({"face_id": face_id, "barycentrics": barycentrics}, attributes, faces, {"values": grad})
    return found["barycentrics"], found["attributes"]
