"""Core of every front: NumPy arrays rendered by frames of the library, and their gradients."""
import collections
import ctypes
import functools
import re
import weakref

import numpy as np

from . import _arrays, _library, _merged

WITH_GRADIENTS = {"depth": 1, "position": 3, "normal": 3, "texcoords": 2}
"""Outputs with gradients, and how many numbers a pixel of theirs has."""
OTHERS = {"face_id": (), "barycentrics": (3,), "uv": (2,), "effective_faces": ()}
NOTHING_RENDERED = ("dpr: every triangle was dropped: outside the image, nearer than znear, beyond zfar, culled, or without "
                     "area")
_OF_OUTPUTS = {"vertices", "views", "intrinsics", "texcoords", "sigma", "gamma", "alpha"}
"""Arrays that outputs beside the image depend on."""
_LEAST_WEIGHT, _ROUNDING = 1e-12, 1e-6
_ELEMENTS = {np.dtype(np.float32): 0, np.dtype(np.int32): 1, np.dtype(np.int64): 2}

Spec = collections.namedtuple("Spec", "device width height is_lit settings outputs parts")
"""All of a call but its arrays, as numbers, words and tuples of words: compilers of graphs take it as a constant. `parts`
are "FRAME|SETTING", and "FRAME|NAME|LEAF|ROW|COUNT": an array of a frame is the LEAF-th of the call's, or a row of it,
or the beginning of that; ROW and COUNT may be empty."""


class Part(collections.namedtuple("Part", "name leaf row count")):
    def of(self, array):
        """A frame's part of an array; a view of its memory."""
        if self.row is None:
            return array
        if self.name in ("views", "intrinsics"):
            return array[self.row:self.row + 1]
        return array[self.row][:self.count]


@functools.lru_cache(maxsize=256)
def frames_of(parts):
    """((settings, parts of a frame), ...)"""
    frames = {}
    for text in parts:
        frame, name, *rest = text.split("|")
        settings, own = frames.setdefault(int(frame), ([], []))
        if rest:
            own.append(Part(name, *(int(number) if number else None for number in rest)))
        else:
            settings.append(name)
    return tuple((tuple(settings), tuple(own)) for settings, own in frames.values())


def words(texts):
    """(char*[], count)"""
    return (ctypes.c_char_p * len(texts))(*(text.encode() for text in texts)), len(texts)


def options_of(spec, settings=(), first_view=0, gradients=(), defers_image=False):
    """Options, which keep their words alive."""
    options = _library.Options(ctypes.sizeof(_library.Options), spec.device.encode(), spec.width, spec.height)
    options.settings, options.setting_count = words([*spec.settings, *settings])
    options.is_lit, options.first_view = spec.is_lit, first_view
    options.gradients, options.gradient_count = words(gradients)
    options.defers_image = defers_image
    return options


def c_arrays(named):
    """(name, packed array) pairs as (dpr_array[], count), which keep the arrays alive."""
    slots = (_library.Array * len(named))()
    slots.arrays = [array for _, array in named]
    for slot, (name, array) in zip(slots, named):
        slot.name, slot.data, slot.element = name.encode(), array.ctypes.data, _ELEMENTS[array.dtype]
        slot.dimensions = array.ndim
        slot.shape[:array.ndim] = array.shape
    return slots, len(named)


def _in_words_of_arguments(text, view):
    """An error of the library's arrays as one of the arguments that they are."""
    for array, argument in (("positions", r"vertices[\1]"), ("texels", r"textures, texel \1"),
                            ("texel_opacities", r"textures, alpha of texel \1")):
        text = re.sub(rf"(?<=error: ){array}\[(\d+)\]", argument, text)
    text = text.replace("k_no_texture", "-1")
    if view is None:
        return text
    named = text.replace("(dpr.render)", f"(view {view})").replace("meshes[0]", f"view {view}")
    return named if named != text else text.replace(": got", f" (view {view}): got", 1)


class Frame:
    """A dpr_frame, destroyed with this; not as the process ends, when the driver may be gone."""

    def __init__(self, options, named, view=None):
        """view: number of the only one, of a mesh in a list, for errors"""
        handle = ctypes.c_void_p()
        try:
            _library.call("dpr_frame_render", ctypes.byref(options), *c_arrays(named), ctypes.byref(handle))
        except _library.InvalidArgument as error:
            raise _library.InvalidArgument(_in_words_of_arguments(str(error), view)) from None
        self.handle = handle
        weakref.finalize(self, _library.library.dpr_frame_destroy, handle).atexit = False

    def is_empty(self):
        result = ctypes.c_int()
        _library.call("dpr_frame_is_empty", self.handle, ctypes.byref(result))
        return bool(result.value)


class Cut:
    """A dpr_cut's arrays: faces, face_of, vertices_of, vertex_weights."""

    def __init__(self, spec, named, tolerance):
        handle = ctypes.c_void_p()
        options = options_of(spec)
        _library.call("dpr_cut_create", ctypes.byref(options), *c_arrays(named), tolerance, ctypes.byref(handle))
        try:
            faces, vertices = ctypes.c_size_t(), ctypes.c_size_t()
            _library.call("dpr_cut_size", handle, ctypes.byref(faces), ctypes.byref(vertices))
            self.faces, self.face_of = np.empty((faces.value, 3), np.int64), np.empty(faces.value, np.int64)
            self.vertices_of = np.empty((vertices.value, 3), np.int64)
            self.vertex_weights = np.empty((vertices.value, 3), np.float32)
            _library.call("dpr_cut_read", handle, *c_arrays(list(vars(self).items())))
        finally:
            _library.library.dpr_cut_destroy(handle)


def _means(name, sums):
    """(values [..., channels], what they were divided by [..., 1]) from sums over the faces, weight times value, and of
    their weights."""
    values, weights = sums[..., :WITH_GRADIENTS[name]], sums[..., 3:]
    divisor = np.linalg.norm(values, axis=-1, keepdims=True) if name == "normal" else weights
    is_seen = (weights > _LEAST_WEIGHT) & (divisor > _LEAST_WEIGHT)
    return np.where(is_seen, values, 0) / np.where(is_seen, divisor, 1), np.where(is_seen, divisor, np.inf)


def _gradient_of_means(name, sums, grad):
    """The gradient of the sums."""
    values, divisor = _means(name, sums)
    grad = grad.reshape(values.shape) / divisor
    along = (grad * values).sum(-1, keepdims=True)
    result = np.zeros_like(sums)
    result[..., :values.shape[-1]] = grad - values * along if name == "normal" else grad
    if name != "normal":
        result[..., 3:] = -along
    return result


def shapes_of(spec, views):
    """[(shape, type)] of the image and the outputs."""
    size = (views, spec.height, spec.width)
    channels = {name: () if count == 1 else (count,) for name, count in WITH_GRADIENTS.items()}
    channels.update(OTHERS)
    return [(size + (4,), np.float32)] + [(size + channels[name], np.int64 if name == "face_id" else np.float32)
                                          for name in spec.outputs]


def _faces_beyond(zfar, vertices, faces, views):
    """Number of triangles, of all views, that lie behind the plane."""
    axes = views[:, 2, :]
    depths = -(vertices @ axes[:, :3, None])[..., 0] - axes[:, 3:]
    is_beyond = depths > zfar * (1 + _ROUNDING)
    return int(is_beyond[:, faces].all(2).sum()) if is_beyond.any() else 0


class Rendered:
    """A call's frames, and what they show.

    outputs  [image, *those of spec.outputs]
    warning  about triangles that a frame does not show; None without
    """

    def __init__(self, spec, arrays, wanted):
        """arrays: of float32, int32 or int64; wanted: indices of those with derivatives."""
        arrays = [np.ascontiguousarray(array).reshape(array.shape) for array in arrays]
        self.spec, self._shapes, self._frames, self.warning = spec, [array.shape for array in arrays], [], None
        self._wanted = wanted
        frames = frames_of(spec.parts)
        views = next((arrays[part.leaf] for part in frames[0][1] if part.name == "views"))
        shapes = shapes_of(spec, len(views) if views.ndim else 0)
        raw = {name: np.empty(shape[:3] + (4,) if name in WITH_GRADIENTS else shape, dtype)
               for name, (shape, dtype) in zip(["image", *spec.outputs], shapes)}
        for group in _merged.groups_of(spec, frames, arrays):
            self._render(group, frames, arrays, wanted, raw)
        self._sums = {name: raw[name] for name in spec.outputs if name in WITH_GRADIENTS}
        self.outputs = [_means(name, array)[0].reshape(shape) if name in WITH_GRADIENTS else array
                        for (name, array), (shape, _) in zip(raw.items(), shapes)]

    def _render(self, group, frames, arrays, wanted, raw):
        """Renders a group of frames, by their numbers, as one, and reads what it shows."""
        own = [frames[i] for i in group]
        lot = _merged.Merged(own, arrays) if len(own) > 1 else _merged.Single(*own[0], arrays, len(frames) == 1)
        rows = slice(None) if len(group) == len(frames) else group
        has_mesh = any(name == "faces" for name, _ in lot.named)
        options = options_of(self.spec, lot.settings, group[0], lot.names(wanted))
        named = lot.named if has_mesh else [*lot.named, *_merged.NO_MESH.items()]
        try:
            frame = Frame(options, named, group[0] if len(frames) > 1 else None)
        except _library.InvalidArgument:
            if len(group) == 1:
                raise
            return [self._render([i], frames, arrays, wanted, raw) for i in group]  # each says what is wrong, or is rendered
        found = {name: array if rows == slice(None) else np.empty_like(array[rows], order="C") for name, array in raw.items()}
        _library.call("dpr_frame_read", frame.handle, *c_arrays(list(found.items())))
        if rows != slice(None):
            for name, array in found.items():
                raw[name][rows] = array
        self._frames.append((frame, lot, rows))
        if has_mesh:
            self._warn(frame, group if len(frames) > 1 else [], [parts for _, parts in own], arrays, found["image"])

    def _warn(self, frame, views, parts, arrays, images):
        """Notes that a view shows nothing, or that triangles lie beyond zfar; views: the numbers of those in a list."""
        zfar = next((float(text[5:]) for text in reversed(self.spec.settings) if text.startswith("zfar=")), None)
        empty = [view for view, image in zip(views, images) if not image[..., 3].any()] if len(views) > 1 else views
        if frame.is_empty() or len(views) > 1 and empty:
            self.warning = self.warning or NOTHING_RENDERED + (f" (view {empty[0]})" if empty else "")
        for of_view in parts if zfar is not None else ():
            named = {part.name: part.of(arrays[part.leaf]) for part in of_view}
            count = _faces_beyond(zfar, named["vertices"], named["faces"], named["views"])
            if count:
                self.warning = self.warning or f"dpr: {count} triangles lie beyond zfar ({zfar:g}) and were left out"

    def constants(self, wanted):
        """The outputs, as numbers of them, that depend on none of the wanted arrays."""
        names = {part.leaf: part.name for _, parts in frames_of(self.spec.parts) for part in parts}
        depend = any(names.get(leaf, "vertices") in _OF_OUTPUTS for leaf in wanted)  # those of no frame are of empty meshes
        return [1 + i for i, name in enumerate(self.spec.outputs) if name in OTHERS or not depend]

    def gradients(self, grads):
        """{index: gradient} of sum <grad, output>, of the outputs whose grad is not None."""
        raw = {}
        for name, grad in zip(["image", *self.spec.outputs], grads):
            if grad is None or name in OTHERS:
                continue
            grad = np.asarray(grad, np.float32)
            raw[name] = np.ascontiguousarray(grad if name == "image" else _gradient_of_means(name, self._sums[name], grad))
        totals = {leaf: np.zeros(self._shapes[leaf], np.float32) for leaf in self._wanted}
        for frame, lot, rows in self._frames:
            of_images, found = [(name, grad[rows]) for name, grad in raw.items()], lot.gradients(totals)
            _library.call("dpr_frame_backward", frame.handle, *c_arrays(of_images), *c_arrays(found))
            lot.add(found, totals)
        return totals

    def tangents(self, given):
        """Derivatives of the images, [K, N, height, width, 4], along {index: [K, ...]} of arrays that were wanted."""
        constants = self.constants(given)
        for i, name in enumerate(self.spec.outputs, 1):
            if i not in constants:
                _arrays.fail(_library.InvalidArgument, "outputs", repr(name), "in forward mode none with gradients: the image "
                             "alone has tangents")
        given = {leaf: np.ascontiguousarray(tangent, np.float32) for leaf, tangent in given.items()}
        count = len(next(iter(given.values())))
        images = np.empty((count, *self.outputs[0].shape), np.float32)
        for frame, lot, rows in self._frames:
            named = lot.tangents(given, count)
            found = images if rows == slice(None) else np.empty_like(images[:, rows], order="C")
            _library.call("dpr_frame_tangent", frame.handle, count, *c_arrays(named), found.ctypes.data, found.size)
            if found is not images:
                images[:, rows] = found
        return images
