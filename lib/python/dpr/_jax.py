"""The front of JAX: functions with derivatives in both modes that call back to this process, under jit too."""
import functools
import warnings

import jax
import numpy as np
from jax.extend.core import Primitive
from jax.interpreters import ad, batching, mlir

from . import _arrays, _frames, _rasterized, _texture_maps


# Three kinds of pass from a call's arrays to outputs. Before one runs, JAX asks for the outputs' shapes, and which have
# derivatives. One that runs is made of (spec, arrays, numbers of the arrays with derivatives).


class _Images(_frames.Rendered):
    """(arrays of a call) to its image and outputs."""

    @staticmethod
    def shapes(spec, arrays):
        return _frames.shapes_of(spec, _view_count(spec, arrays))

    @staticmethod
    def differentiable(spec):
        return [0] + [i for i, name in enumerate(spec.outputs, 1) if name in _frames.WITH_GRADIENTS]

    def tangents(self, given):
        images = super().tangents(given)
        return [images, *(np.zeros((len(images), *self.outputs[i].shape), np.float32)
                          for i in self.differentiable(self.spec)[1:])]


class _Layers(_rasterized.Rasterized):
    """(arrays of a call) to face_id, barycentrics and depth, for shading of the caller's own."""

    @staticmethod
    def shapes(spec, arrays):
        raster = _rasterized.raster_of(spec)
        size = (raster.layers, _view_count(spec, arrays), raster.height, raster.width)
        return [(size, np.int64), ((*size, 3), np.float32), (size, np.float32)]

    @staticmethod
    def differentiable(spec):
        return [1, 2]


class _Resolved(_rasterized.Rasterized):
    """(arrays of a call, values of its samples) to images."""

    def __init__(self, spec, arrays, wanted):
        *leaves, self._values = arrays
        self._number = len(leaves)  # of the values
        super().__init__(spec, leaves, [i for i in wanted if i < self._number])
        self.warning = None

    @property
    def outputs(self):
        return [self.resolve(self._values)]

    @staticmethod
    def shapes(spec, arrays):
        return [((_view_count(spec, arrays), spec.height, spec.width, arrays[-1].shape[-1]), np.float32)]

    @staticmethod
    def differentiable(spec):
        return [0]

    def tangents(self, given):
        count = len(next(iter(given.values())))
        return [self.resolve_tangents(count, self._values, given.get(self._number), given)]

    def gradients(self, grads):
        grad_values, found = self.resolve_gradients(self._values, grads[0])
        return {**found, self._number: grad_values}


def _view_count(spec, arrays):
    return arrays[next(int(part.split("|")[2]) for part in spec.parts if "|views|" in part)].shape[0]


def _ran(kind, spec, arrays, wanted):
    return kind(spec, [np.asarray(array) for array in arrays], wanted)


def _as_jax_has_them(outputs):
    return tuple(output.astype(np.int32) if output.dtype == np.int64 and not jax.config.jax_enable_x64 else output
                 for output in outputs)


@functools.partial(jax.custom_jvp, nondiff_argnums=(0, 1))
def _run(kind, spec, arrays):
    """The outputs. Their warnings are told where they are computed."""
    def forward(*arrays):
        found = _ran(kind, spec, arrays, ())
        if found.warning:
            warnings.warn(found.warning)
        return _as_jax_has_them(found.outputs)

    shapes = tuple(jax.ShapeDtypeStruct(shape, jax.dtypes.canonicalize_dtype(dtype))
                   for shape, dtype in kind.shapes(spec, arrays))
    return jax.pure_callback(forward, shapes, *arrays, vmap_method="sequential")


def _push(kind, spec, primals, tangents):
    (arrays,), (tangents,) = primals, tangents
    outputs = _run(kind, spec, arrays)
    symbolic_zero = jax.custom_derivatives.SymbolicZero
    wanted = tuple(i for i, tangent in enumerate(tangents)
                   if not isinstance(tangent, symbolic_zero) and arrays[i].dtype == np.float32)
    found = {}
    if wanted:
        moved = _tangents_p.bind(*arrays, *(tangents[i][None] for i in wanted), kind=kind, spec=spec, wanted=wanted)
        found = {i: tangent[0] for i, tangent in zip(kind.differentiable(spec), moved)}
    return outputs, tuple(found[i] if i in found else _no_tangent(output) for i, output in enumerate(outputs))


def _no_tangent(output):
    if output.dtype == np.float32:
        return jax.numpy.zeros_like(output)
    return np.zeros(output.shape, jax.dtypes.float0)


_run.defjvp(_push, symbolic_zeros=True)

_tangents_p = Primitive("dpr_tangents")
"""From arrays, and tangents [K, ...] of the wanted ones, to those of the outputs that have derivatives, [K, ...]. What a
compiled program does between the passes is not known here, so that each renders again."""
_tangents_p.multiple_results = True


def _shapes_of_tangents(*arrays, kind, spec, wanted):
    shapes, count = kind.shapes(spec, arrays[:-len(wanted)]), arrays[-1].shape[0]
    return [jax.ShapeDtypeStruct((count, *shapes[i][0]), np.float32) for i in kind.differentiable(spec)]


def _tangents(*arrays, kind, spec, wanted):
    def forward(arrays, tangents):
        return _ran(kind, spec, arrays, wanted).tangents(dict(zip(wanted, map(np.asarray, tangents))))

    shapes = _shapes_of_tangents(*arrays, kind=kind, spec=spec, wanted=wanted)
    return jax.pure_callback(forward, shapes, arrays[:-len(wanted)], arrays[-len(wanted):])


def _pull_back(cotangents, *arrays, kind, spec, wanted):
    arrays, tangents = arrays[:-len(wanted)], arrays[-len(wanted):]
    given = {i: grad for i, grad in zip(kind.differentiable(spec), cotangents) if not isinstance(grad, ad.Zero)}
    shapes = [jax.ShapeDtypeStruct(tangent.aval.shape, np.float32) for tangent in tangents]
    outputs = range(len(kind.shapes(spec, arrays)))

    def backward(arrays, given):
        ran, given = _ran(kind, spec, arrays, wanted), {i: np.asarray(grads) for i, grads in given.items()}
        found = [ran.gradients([given[i][k] if i in given else None for i in outputs]) for k in range(shapes[0].shape[0])]
        return [np.stack([gradients[i] for gradients in found]) for i in wanted]

    called = jax.custom_jvp(lambda *given: jax.pure_callback(backward, shapes, *given, vmap_method="sequential"))
    called.defjvp(_refuse)
    return [None] * len(arrays) + called(arrays, given)


def _batch(arrays, dimensions, *, wanted, **constants):
    """Directions join those that there are; meshes and cameras of their own are rendered one after the other."""
    size = next(array.shape[dimension] for array, dimension in zip(arrays, dimensions) if dimension is not None)
    bind = functools.partial(_tangents_p.bind, wanted=wanted, **constants)

    def first(array, dimension):
        if dimension is None:
            return jax.numpy.broadcast_to(array, (size, *array.shape))
        return jax.numpy.moveaxis(array, dimension, 0)

    count = len(arrays) - len(wanted)
    if any(dimension is not None for dimension in dimensions[:count]):
        found = jax.lax.map(lambda row: bind(*row), tuple(map(first, arrays, dimensions)))
    else:
        tangents = map(first, arrays[count:], dimensions[count:])
        rows = (tangent.reshape(size * tangent.shape[1], *tangent.shape[2:]) for tangent in tangents)
        found = bind(*arrays[:count], *rows)
        found = [tangent.reshape(size, -1, *tangent.shape[1:]) for tangent in found]
    return found, [0] * len(found)


def _refuse(*arguments, **constants):
    raise NotImplementedError("dpr: error: derivative (dpr.render): got a second one, expected the first: there are no second "
                              "derivatives")


_tangents_p.def_impl(_tangents)
_tangents_p.def_abstract_eval(
    lambda *arrays, **constants: [jax.core.ShapedArray(shape.shape, shape.dtype)
                                  for shape in _shapes_of_tangents(*arrays, **constants)])
mlir.register_lowering(_tangents_p, mlir.lower_fun(_tangents, multiple_results=True))
batching.primitive_batchers[_tangents_p] = _batch
ad.primitive_transposes[_tangents_p] = _pull_back
ad.primitive_jvps[_tangents_p] = _refuse


def render(spec, leaves):
    """The outputs."""
    return list(_run(_Images, spec, [jax.numpy.asarray(leaf) for leaf in leaves]))


class _Traced:
    """What Samples need of a frame that is yet to come."""

    def __init__(self, spec):
        self.spec, self.raster, self.warning = spec, _rasterized.raster_of(spec), None


def rasterize(spec, leaves):
    """(what Samples need of a frame, its outputs, the arrays that resolve() depends on)"""
    leaves = [jax.numpy.asarray(leaf) for leaf in leaves]
    return _Traced(spec), _run(_Layers, spec, leaves), leaves


def resolve(traced, values, leaves):
    size = _Layers.shapes(traced.spec, leaves)[2][0][1:]
    if values.ndim != 4 or values.shape[:3] != size or not values.size:
        _arrays.fail(ValueError, "values", list(values.shape), f"[{', '.join(map(str, size))}, C]", "dpr.Samples")
    return _run(_Resolved, traced.spec, [*leaves, jax.numpy.asarray(values, np.float32)])[0]


def texture(lookup, arrays):
    return _run(_texture_maps.Read, lookup, [jax.numpy.asarray(array) for array in arrays])[0]
