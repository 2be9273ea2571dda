"""The front of JAX: a function with derivatives that calls back to this process, under jit too."""
import functools
import warnings

import jax
import numpy as np

from . import _frames


class _Constant:
    """A value that JAX passes from the forward to the backward pass as it is."""

    def __init__(self, value):
        self.value = value

    def __hash__(self):
        return hash(self.value)

    def __eq__(self, other):
        return isinstance(other, _Constant) and self.value == other.value


jax.tree_util.register_pytree_node(_Constant, lambda constant: ((), constant.value), lambda value, _: _Constant(value))


def _forward(spec, wanted, *leaves):
    rendered = _frames.Rendered(spec, [np.asarray(leaf) for leaf in leaves], wanted)
    if rendered.warning:
        warnings.warn(rendered.warning)
    return tuple(output.astype(np.int32) if output.dtype == np.int64 and not jax.config.jax_enable_x64 else output
                 for output in rendered.outputs)


def _call(spec, wanted, leaves):
    views = next(int(part.split("|")[2]) for part in spec.parts if "|views|" in part)
    shapes = tuple(jax.ShapeDtypeStruct(shape, jax.dtypes.canonicalize_dtype(dtype))
                   for shape, dtype in _frames.shapes_of(spec, leaves[views].shape[0]))
    return jax.pure_callback(functools.partial(_forward, spec, wanted), shapes, *leaves, vmap_method="sequential")


@functools.partial(jax.custom_vjp, nondiff_argnums=(0,))
def _render(spec, leaves):
    return _call(spec, (), leaves)


def _render_and_keep(spec, leaves):
    wanted = tuple(i for i, leaf in enumerate(leaves) if leaf.perturbed and leaf.value.dtype == np.float32)
    leaves = [leaf.value for leaf in leaves]
    return _call(spec, wanted, leaves), (leaves, _Constant(wanted))


def _pull_back(spec, kept, grads):
    """The frame is rendered again: what a compiled program does between the passes is not known here."""
    leaves, wanted = kept
    symbolic_zero = jax.custom_derivatives.SymbolicZero
    with_gradients = [True] + [name in _frames.WITH_GRADIENTS for name in spec.outputs]
    names = [i for i, (grad, has) in enumerate(zip(grads, with_gradients)) if has and not isinstance(grad, symbolic_zero)]
    shapes = tuple(jax.ShapeDtypeStruct(leaves[i].shape, np.float32) for i in wanted.value)

    def backward(leaves, given):
        all_grads = dict(zip(names, given))
        rendered = _frames.Rendered(spec, [np.asarray(leaf) for leaf in leaves], wanted.value)
        found = rendered.gradients([all_grads.get(i) for i in range(len(with_gradients))], wanted.value)
        return tuple(found[i] for i in wanted.value)

    found = jax.pure_callback(backward, shapes, leaves, [grads[i] for i in names], vmap_method="sequential")
    gradients = dict(zip(wanted.value, found))
    return ([gradients.get(i) for i in range(len(leaves))],)


_render.defvjp(_render_and_keep, _pull_back, symbolic_zeros=True)


def render(spec, leaves):
    """The outputs. Their warnings are told where they are computed."""
    return list(_render(spec, [jax.numpy.asarray(leaf) for leaf in leaves]))
