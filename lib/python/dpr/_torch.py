"""The front of PyTorch: a function with derivatives, and the same as operators for torch.compile."""
import functools
import itertools
import weakref

import numpy as np
import torch

from . import _arrays, _frames
from ._frames import Rendered, Spec

_COMPILES = hasattr(torch.library, "register_autograd")  # from 2.4 on


def is_compiling():
    return _COMPILES and torch.compiler.is_compiling()


def _tensor(array):
    return torch.from_dlpack(array)


def _require_first_derivative():
    if torch.is_grad_enabled():
        raise RuntimeError(
            "dpr: error: create_graph (dpr.render): got true, expected false: there are no second derivatives")


def _gradients(rendered, grads, tensors, wanted):
    """Gradient of each tensor, None where not wanted."""
    found = rendered.gradients([None if grad is None else _arrays.to_numpy(grad) for grad in grads], wanted)
    return [_tensor(found[i]) if i in found else None for i in range(len(tensors))]


class _Render(torch.autograd.Function):
    @staticmethod
    def forward(ctx, spec, wanted, told, *tensors):
        rendered = Rendered(spec, [_arrays.to_numpy(tensor) for tensor in tensors], wanted)
        told.append(rendered.warning)
        outputs = [_tensor(array) for array in rendered.outputs]
        ctx.rendered, ctx.wanted, ctx.count = rendered, wanted, len(tensors)
        ctx.set_materialize_grads(False)
        ctx.save_for_backward(*tensors)  # so that a change in place is noticed
        ctx.mark_non_differentiable(*(outputs[i] for i in rendered.constants(wanted)))
        return tuple(outputs)

    @staticmethod
    def backward(ctx, *grads):
        _require_first_derivative()
        tensors = ctx.saved_tensors
        if all(grad is None for grad in grads):
            return (None,) * (3 + len(tensors))
        return (None, None, None, *_gradients(ctx.rendered, grads, tensors, ctx.wanted))


def render(spec, leaves, copy):
    """(outputs, warning)"""
    home = next(leaf.device for leaf in leaves if isinstance(leaf, torch.Tensor))
    tensors = [leaf if isinstance(leaf, torch.Tensor) else torch.from_dlpack(_arrays.to_numpy(leaf)) for leaf in leaves]
    if copy:
        tensors = [tensor.cpu() for tensor in tensors]
    wanted = [i for i, tensor in enumerate(tensors) if tensor.requires_grad]
    if is_compiling():
        outputs, warning = torch.ops.dpr.render(tensors, wanted, _text_of(spec))[:-1], None
    else:
        told = []
        outputs = _Render.apply(spec, tuple(wanted), told, *tensors)
        (warning,) = told
    if copy:
        outputs = [tensor.to(home) for tensor in outputs]
    return list(outputs), warning


def _text_of(spec):
    """As operators take it, and have derivatives: lists of words are for those of PyTorch trees of tensors."""
    return "\n".join([spec.device, str(spec.width), str(spec.height), str(spec.is_lit),
                      *("\t".join(words) for words in (spec.settings, spec.outputs, spec.parts))])


@functools.lru_cache(maxsize=256)
def _spec_of(text):
    device, width, height, is_lit, *words = text.split("\n")
    return Spec(device, int(width), int(height), int(is_lit), *(tuple(text.split("\t")) if text else () for text in words))


_rendered = {}
"""State of compiled graphs, by the number in a tensor that they pass on; forgotten with the tensor's memory."""
_numbers = itertools.count()


def _token(rendered):
    number = next(_numbers)
    memory = np.array([number], np.int64)
    _rendered[number] = rendered
    weakref.finalize(memory, _rendered.pop, number, None).atexit = False
    return _tensor(memory)


def _register():
    define, implement, fake = torch.library.define, torch.library.impl, torch.library.register_fake
    define("dpr::render", "(Tensor[] tensors, int[] wanted, str spec) -> Tensor[]")
    define("dpr::gradients", "(Tensor token, Tensor[] grads, int[] of, Tensor[] tensors, int[] wanted) -> Tensor[]")

    @implement("dpr::render", "cpu")
    def forward(tensors, wanted, spec):
        rendered = Rendered(_spec_of(spec), [_arrays.to_numpy(tensor) for tensor in tensors], tuple(wanted))
        return [*(_tensor(array) for array in rendered.outputs), _token(rendered)]

    @implement("dpr::gradients", "cpu")
    def gradients(token, grads, of, tensors, wanted):
        """`of`: the numbers of the outputs that have these gradients."""
        all_grads = dict(zip(of, grads))
        rendered = _rendered[int(token)]
        found = _gradients(rendered, [all_grads.get(i) for i in range(1 + len(rendered.spec.outputs))], tensors, wanted)
        return [gradient for gradient in found if gradient is not None]

    @fake("dpr::render")
    def forward_shapes(tensors, wanted, spec):
        spec = _spec_of(spec)
        views = next(int(part.split("|")[2]) for part in spec.parts if "|views|" in part)
        types = {np.float32: torch.float32, np.int64: torch.int64}
        outputs = [tensors[0].new_empty(shape, dtype=types[dtype])
                   for shape, dtype in _frames.shapes_of(spec, tensors[views].shape[0])]
        return [*outputs, tensors[0].new_empty((1,), dtype=torch.int64)]

    @fake("dpr::gradients")
    def gradient_shapes(token, grads, of, tensors, wanted):
        return [tensors[i].new_empty(tensors[i].shape) for i in wanted]

    def keep(ctx, inputs, output):
        tensors, ctx.wanted, spec = inputs
        ctx.outputs = _spec_of(spec).outputs
        ctx.count = len(tensors)
        ctx.save_for_backward(output[-1], *tensors)

    def backward(ctx, grads):
        token, *tensors = ctx.saved_tensors
        differentiable = [0] + [1 + i for i, name in enumerate(ctx.outputs) if name in _frames.WITH_GRADIENTS]
        of = [i for i in differentiable if grads[i] is not None]
        found = iter(torch.ops.dpr.gradients(token, [grads[i] for i in of], of, tensors, ctx.wanted))
        of_tensors = [next(found) if i in ctx.wanted else None for i in range(ctx.count)]
        return of_tensors, None, None

    torch.library.register_autograd("dpr::render", backward, setup_context=keep)


if _COMPILES:
    _register()
