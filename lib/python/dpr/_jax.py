"""The front of JAX: a function with derivatives that calls back to this process, under jit too."""
import functools
import warnings

import jax
import numpy as np
from jax.extend.core import Primitive
from jax.interpreters import ad, batching, mlir

from . import _arrays, _frames, _samples


def _forward(spec, *leaves):
    rendered = _rendered(spec, leaves, ())
    if rendered.warning:
        warnings.warn(rendered.warning)
    return _as_jax_has_them(rendered.outputs)


def _as_jax_has_them(outputs):
    return tuple(output.astype(np.int32) if output.dtype == np.int64 and not jax.config.jax_enable_x64 else output
                 for output in outputs)


def _view_count(spec, leaves):
    return leaves[next(int(part.split("|")[2]) for part in spec.parts if "|views|" in part)].shape[0]


def _shapes(spec, leaves):
    """Of the image and the outputs."""
    return tuple(jax.ShapeDtypeStruct(shape, jax.dtypes.canonicalize_dtype(dtype))
                 for shape, dtype in _frames.shapes_of(spec, _view_count(spec, leaves)))


def _call(spec, leaves):
    return jax.pure_callback(functools.partial(_forward, spec), _shapes(spec, leaves), *leaves, vmap_method="sequential")


@functools.partial(jax.custom_jvp, nondiff_argnums=(0,))
def _render(spec, leaves):
    return _call(spec, leaves)


def _differentiable(spec):
    """Numbers of the outputs that have derivatives."""
    return [0] + [i for i, name in enumerate(spec.outputs, 1) if name in _frames.WITH_GRADIENTS]


def _push(spec, primals, tangents):
    (leaves,), (tangents,) = primals, tangents
    outputs = _render(spec, leaves)
    symbolic_zero = jax.custom_derivatives.SymbolicZero
    wanted = tuple(i for i, tangent in enumerate(tangents)
                   if not isinstance(tangent, symbolic_zero) and leaves[i].dtype == np.float32)
    found = {}
    if wanted:
        moved = _tangents_p.bind(*leaves, *(tangents[i][None] for i in wanted), spec=spec, wanted=wanted)
        found = {i: tangent[0] for i, tangent in zip(_differentiable(spec), moved)}
    return outputs, tuple(found[i] if i in found else _no_tangent(output) for i, output in enumerate(outputs))


def _no_tangent(output):
    if output.dtype == np.float32:
        return jax.numpy.zeros_like(output)
    return np.zeros(output.shape, jax.dtypes.float0)


_render.defjvp(_push, symbolic_zeros=True)

_tangents_p = Primitive("dpr_tangents")
"""From leaves, and tangents [K, ...] of the wanted ones, to those of the outputs that have derivatives, [K, ...]. What a
compiled program does between the passes is not known here, so that each renders again."""
_tangents_p.multiple_results = True


def _rendered(spec, leaves, wanted):
    return _frames.Rendered(spec, [np.asarray(leaf) for leaf in leaves], wanted)


def _shapes_of_tangents(*arrays, spec, wanted):
    shapes = _shapes(spec, arrays)
    return [jax.ShapeDtypeStruct((arrays[-1].shape[0], *shapes[i].shape), np.float32) for i in _differentiable(spec)]


def _tangents(*arrays, spec, wanted):
    shapes = _shapes_of_tangents(*arrays, spec=spec, wanted=wanted)

    def forward(leaves, tangents):
        images = _rendered(spec, leaves, wanted).tangents(dict(zip(wanted, map(np.asarray, tangents))))
        return [images, *(np.zeros(shape.shape, np.float32) for shape in shapes[1:])]

    return jax.pure_callback(forward, shapes, arrays[:-len(wanted)], arrays[-len(wanted):])


def _pull_back(cotangents, *arrays, spec, wanted):
    leaves, tangents = arrays[:-len(wanted)], arrays[-len(wanted):]
    given = {i: grad for i, grad in zip(_differentiable(spec), cotangents) if not isinstance(grad, ad.Zero)}
    shapes = [jax.ShapeDtypeStruct(tangent.aval.shape, np.float32) for tangent in tangents]

    def backward(leaves, given):
        rendered, given = _rendered(spec, leaves, wanted), {i: np.asarray(grads) for i, grads in given.items()}
        found = [rendered.gradients([given[i][k] if i in given else None for i in range(1 + len(spec.outputs))], wanted)
                 for k in range(shapes[0].shape[0])]
        return [np.stack([gradients[i] for gradients in found]) for i in wanted]

    return [None] * len(leaves) + jax.pure_callback(backward, shapes, leaves, given, vmap_method="sequential")


def _batch(arrays, dimensions, *, spec, wanted):
    """Directions join those that there are; meshes and cameras of their own are rendered one after the other."""
    size = next(array.shape[dimension] for array, dimension in zip(arrays, dimensions) if dimension is not None)
    bind = functools.partial(_tangents_p.bind, spec=spec, wanted=wanted)

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
    """The outputs. Their warnings are told where they are computed."""
    return list(_render(spec, [jax.numpy.asarray(leaf) for leaf in leaves]))


# ---- Shading of the caller's own: in reverse mode. Each pass rasterizes again. ----

class _Traced:
    """What Samples need of a frame that is yet to come."""

    def __init__(self, spec):
        self.spec, self.raster, self.warning = spec, _samples.raster_of(spec), None


def _rasterized(spec, leaves):
    leaves = [np.asarray(leaf) for leaf in leaves]
    return _samples.Rasterized(spec, leaves, [i for i, leaf in enumerate(leaves) if leaf.dtype == np.float32])


def _shapes_of_samples(spec, leaves):
    raster = _samples.raster_of(spec)
    size = (raster.layers, _view_count(spec, leaves), raster.height, raster.width)
    return (jax.ShapeDtypeStruct(size, jax.dtypes.canonicalize_dtype(np.int64)),
            jax.ShapeDtypeStruct((*size, 3), np.float32), jax.ShapeDtypeStruct(size, np.float32))


@functools.partial(jax.custom_vjp, nondiff_argnums=(0,))
def _samples_of(spec, leaves):
    def forward(*leaves):
        rasterized = _rasterized(spec, leaves)
        if rasterized.warning:
            warnings.warn(rasterized.warning)
        return _as_jax_has_them(rasterized.outputs)

    return jax.pure_callback(forward, _shapes_of_samples(spec, leaves), *leaves, vmap_method="sequential")


def _of_floats(leaves):
    return [jax.ShapeDtypeStruct(leaf.shape, np.float32) for leaf in leaves if leaf.dtype == np.float32]


def _by_leaf(leaves, gradients):
    gradients = iter(gradients)
    return [next(gradients) if leaf.dtype == np.float32 else None for leaf in leaves]


def _samples_backward(spec, leaves, cotangents):
    def backward(leaves, grads):
        rasterized = _rasterized(spec, leaves)
        found = rasterized.gradients(dict(zip(("barycentrics", "depth"), grads)))
        return [found[leaf] for leaf in sorted(found)]

    found = jax.pure_callback(backward, _of_floats(leaves), leaves, cotangents[1:], vmap_method="sequential")
    return (_by_leaf(leaves, found),)


_samples_of.defvjp(lambda spec, leaves: (_samples_of(spec, leaves), leaves), _samples_backward)


@functools.partial(jax.custom_vjp, nondiff_argnums=(0,))
def _resolve(spec, values, leaves):
    def forward(values, *leaves):
        return _rasterized(spec, leaves).resolve(np.asarray(values))

    shape = (_view_count(spec, leaves), spec.height, spec.width, values.shape[-1])
    return jax.pure_callback(forward, jax.ShapeDtypeStruct(shape, np.float32), values, *leaves, vmap_method="sequential")


def _resolve_backward(spec, kept, grad_images):
    values, leaves = kept

    def backward(values, leaves, grad_images):
        rasterized = _rasterized(spec, leaves)
        grad_values, found = rasterized.resolve_gradients(np.asarray(values), np.asarray(grad_images))
        return [grad_values, *(found[leaf] for leaf in sorted(found))]

    shapes = [jax.ShapeDtypeStruct(values.shape, np.float32), *_of_floats(leaves)]
    grad_values, *found = jax.pure_callback(backward, shapes, values, leaves, grad_images, vmap_method="sequential")
    return grad_values, _by_leaf(leaves, found)


_resolve.defvjp(lambda spec, values, leaves: (_resolve(spec, values, leaves), (values, leaves)), _resolve_backward)


def rasterize(spec, leaves):
    """(what Samples need of a frame, its outputs, the arrays that resolve() depends on)"""
    leaves = [jax.numpy.asarray(leaf) for leaf in leaves]
    return _Traced(spec), _samples_of(spec, leaves), leaves


def resolve(traced, values, leaves):
    size = _shapes_of_samples(traced.spec, leaves)[0].shape[1:]
    if values.ndim != 4 or values.shape[:3] != size or not values.size:
        _arrays.fail(ValueError, "values", list(values.shape), f"[{', '.join(map(str, size))}, C]", "dpr.Samples")
    return _resolve(traced.spec, jax.numpy.asarray(values, np.float32), leaves)
