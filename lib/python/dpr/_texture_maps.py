"""Textures for shading of the caller's own: texels at places, filtered, with derivatives."""
from typing import Any, Callable, Dict, NamedTuple, Optional, Tuple

import numpy as np

from . import _arrays, _frames, _library

Array = Any


class Lookup(NamedTuple):
    """A call's words, and the names of its arrays, of which the first are coordinates and the last texels."""
    names: Tuple[str, ...]
    wrap: str
    filter: str


def _one(array):
    return _frames.c_arrays([("values", array)])[0]


class Read:
    """A lookup's arrays, packed, and the values there. The arrays of the numbers `wanted` have gradients."""
    warning = None

    def __init__(self, lookup, arrays, wanted=()):
        self._names, self._wanted = lookup.names, wanted
        self._arrays = [np.ascontiguousarray(array, np.float32).reshape(array.shape) for array in arrays]
        self._words = lookup.wrap.encode(), lookup.filter.encode()
        self._shape = self.shapes(lookup, arrays)[0][0]

    @staticmethod
    def shapes(lookup, arrays):
        return [((*arrays[0].shape[:3], arrays[-1].shape[-1]), np.float32)]

    @staticmethod
    def differentiable(lookup):
        return [0]

    def _named(self, arrays):
        """Arrays {number: array} as the library takes them."""
        return _frames.c_arrays([(self._names[i], array) for i, array in arrays.items()])

    def _call(self, function, *arguments):
        _library.call(function, *self._named(dict(enumerate(self._arrays))), *self._words, *arguments)

    @property
    def outputs(self):
        values = np.empty(self._shape, np.float32)
        self._call("dpr_texture_map", _one(values))
        return [values]

    def gradients(self, grads):
        """{number: gradient} of sum <grad, values>."""
        grad = np.ascontiguousarray(grads[0], np.float32)
        found = {i: np.empty(self._arrays[i].shape, np.float32) for i in self._wanted}
        self._call("dpr_texture_map_backward", _one(grad), *self._named(found))
        return found

    def tangents(self, given):
        """[tangents [K, ...] of the values] along {number: [K, ...]}"""
        given = {i: np.ascontiguousarray(tangents, np.float32) for i, tangents in given.items()}
        found = np.empty((len(next(iter(given.values()))), *self._shape), np.float32)
        for k, values in enumerate(found):
            self._call("dpr_texture_map_tangent", *self._named({i: moving[k] for i, moving in given.items()}), _one(values))
        return [found]


def _checked(texels, texcoords, steps, levels, wrap, filter, where):
    """(lookup, arrays by argument, as the library has them)"""
    given = {"texcoords": texcoords, "steps": steps, "levels": levels, "texels": texels}
    arrays = {name: _arrays.converted(name, _arrays.from_numbers(array), where=where)
              for name, array in given.items() if array is not None or name.startswith("tex")}
    for name, word in (("wrap", wrap), ("filter", filter)):
        if not isinstance(word, str):
            _arrays.fail(TypeError, name, repr(word), "a word", where)
    for name, array in arrays.items():
        if _arrays.module_of(array) == "torch" and array.device.type != "cpu":
            _arrays.fail(ValueError, name, f"a tensor on {array.device}", "one on the CPU", where)
    shapes = {name: tuple(array.shape) for name, array in arrays.items()}
    if len(shapes["texcoords"]) != 4 or shapes["texcoords"][-1] not in (2, 3):
        _arrays.fail(ValueError, "texcoords", list(shapes["texcoords"]), "[N, h, w, 2], or directions [N, h, w, 3]", where)
    is_cube = shapes["texcoords"][-1] == 3
    if len(shapes["texels"]) not in (3, 4):
        _arrays.fail(ValueError, "texels", list(shapes["texels"]), "[6, S, S, C] of a cube map" if is_cube else
                     "[H, W, C] or [N, H, W, C]", where)
    if steps is not None:
        if len(shapes["steps"]) != 5 or shapes["steps"][3:] != (shapes["texcoords"][-1], 2):
            _arrays.fail(ValueError, "steps", list(shapes["steps"]), f"[N, h, w, {shapes['texcoords'][-1]}, 2]", where)
        arrays["steps"] = arrays["steps"].reshape(*shapes["steps"][:3], -1)
    if len(shapes["texels"]) == 3:
        arrays["texels"] = _arrays.batched(arrays["texels"])
    names = {"texcoords": "directions" if is_cube else "texcoords", "texels": "texels[0]"}
    return Lookup(tuple(names.get(name, name) for name in arrays), wrap, filter), arrays


@_arrays.named("dpr.texture")
def texture(texels: Array, texcoords: Array, *, steps: Optional[Array] = None, levels: Optional[Array] = None,
            wrap: str = "repeat", filter: str = "bilinear") -> Array:
    """Texels at places, filtered, for shading of one's own: [N, h, w, C].

    texels     [H, W, C] with any number of channels, row 0 on top, of all N images; or [N, H, W, C]. A cube map is
               [6, S, S, C], or [6 N, S, S, C]: OpenGL's faces +x, -x, +y, -y, +z, -z
    texcoords  [N, h, w, 2], u and v, v up, as Samples.interpolate() finds them; or of cube maps directions [N, h, w, 3]
    steps      [N, h, w, 2, 2], or of cube maps [N, h, w, 3, 2]: how fast u changes from sample to sample to the right and
               down, then v, ..., as Samples.interpolate_steps() finds them: with "trilinear" and "mipmap" they say which
               smaller version of the texture is read
    levels     [N, h, w], added to the level, the logarithm to base 2 of texels a sample; without steps the level
    wrap       "repeat", "mirror", "clamp" or "zero"; cube maps go on beyond the borders of their faces
    filter     "nearest", "bilinear", "trilinear", or "mipmap", which reads one smaller version, and does not blend two

    Arrays and lists of floating-point numbers; the result is float32. PyTorch and JAX have derivatives in both modes by all
    arrays; texture_with_vjp() has those of others. Raises ValueError for other shapes and words, and for what is not finite.
    Works on the host."""
    lookup, arrays = _checked(texels, texcoords, steps, levels, wrap, filter, "dpr.texture")
    kinds = {_arrays.module_of(array) for array in arrays.values()}
    if "torch" in kinds:
        from . import _texture
        return _texture.read(lookup, list(arrays.values()))
    if "jax" in kinds:
        from . import _jax
        return _jax.texture(lookup, list(arrays.values()))
    found = Read(lookup, [_arrays.to_numpy(array) for array in arrays.values()]).outputs[0]
    return _arrays.like(texcoords, found) if _arrays.is_array(texcoords) else found


@_arrays.named("dpr.texture_with_vjp")
def texture_with_vjp(texels: Array, texcoords: Array, *, steps: Optional[Array] = None, levels: Optional[Array] = None,
                     wrap: str = "repeat",
                     filter: str = "bilinear") -> Tuple[Array, Callable[[Array], Dict[str, Array]]]:
    """(texture(...), pullback). pullback(grad_values) returns the gradients of the arrays that were given, by name."""
    where = "dpr.texture_with_vjp"
    lookup, arrays = _checked(texels, texcoords, steps, levels, wrap, filter, where)
    read = Read(lookup, [_arrays.to_numpy(array) for array in arrays.values()], range(len(arrays)))
    values = read.outputs[0]
    given = {name: _arrays.from_numbers(array) for name, array in (("texels", texels), ("texcoords", texcoords),
                                                                   ("steps", steps), ("levels", levels))}

    def pullback(grad_values):
        grad = _arrays.to_numpy(_arrays.converted("grad_values", _arrays.from_numbers(grad_values), where=where))
        if grad.shape != values.shape:
            _arrays.fail(ValueError, "grad_values", list(grad.shape), list(values.shape), where)
        found = read.gradients([grad])
        found = dict(zip(arrays, map(found.get, range(len(arrays)))))
        if steps is not None:
            found["steps"] = found["steps"].reshape(tuple(given["steps"].shape))
        return {name: _arrays.restored(given[name], gradient) for name, gradient in found.items()}

    return _arrays.like(arrays["texcoords"], values), pullback
