"""The front of PyTorch: a function with derivatives, and the same as operators for torch.compile."""
import functools
import itertools
import weakref

import numpy as np
import torch
from torch.autograd import forward_ad

from . import _arrays, _frames
from ._frames import Rendered, Spec
from ._rasterized import Rasterized

_COMPILES = hasattr(torch.library, "register_autograd")  # from 2.4 on
_HAS_CONTEXT = hasattr(torch.autograd.Function, "setup_context")  # from 2.0 on, for torch.func


def is_compiling():
    return _COMPILES and torch.compiler.is_compiling()


def _tensor(array):
    return torch.from_dlpack(array)


def _gradients(rendered, grads, tensors):
    """Gradient of each tensor, None where not wanted."""
    found = rendered.gradients([None if grad is None else _arrays.to_numpy(grad) for grad in grads])
    return [_tensor(found[i]) if i in found else None for i in range(len(tensors))]


class _Call:
    """What a forward pass leaves to its derivatives; for torch.func no tree of tensors."""

    def __init__(self, spec, wanted):
        self.spec, self.wanted, self.rendered = spec, wanted, None


def one_forward(function):
    """For PyTorch whose forward() does what setup_context() does later."""
    if _HAS_CONTEXT:
        return function
    apart, keep = function.forward, function.setup_context

    def forward(ctx, *inputs):
        outputs = apart(*inputs)
        keep(ctx, inputs, outputs)
        return outputs

    function.forward = staticmethod(forward)
    return function


def one_by_one(function, info, dimensions, *inputs):
    """Its results, a tuple, for a batch of tensors."""
    found = [function.apply(*(given if dimension is None or not isinstance(given, torch.Tensor) else given.select(dimension, i)
                              for given, dimension in zip(inputs, dimensions))) for i in range(info.batch_size)]
    rows = tuple(None if row[0] is None else torch.stack(row) for row in zip(*found))
    return rows, tuple(None if row is None else 0 for row in rows)


class Derivative(torch.autograd.Function):
    """One that has none itself. The tensors by which it was taken are among its arguments: a second one is refused, not
    dropped. Those of a batch of directions or gradients are taken one after the other, unless it says how else."""

    def __init_subclass__(cls):
        if "vmap" not in vars(cls):
            cls.vmap = staticmethod(functools.partial(one_by_one, cls))

    @staticmethod
    def setup_context(ctx, inputs, outputs):
        pass

    @staticmethod
    def backward(ctx, *grads):
        raise RuntimeError("dpr: error: derivative (dpr.render): got a second one, expected the first: there are no second "
                           "derivatives")

    jvp = backward


@one_forward
class _Gradients(Derivative):
    """(gradients of `count` outputs, all tensors) to gradients of the wanted tensors."""

    @staticmethod
    def forward(call, count, *tensors):
        found = _gradients(call.rendered, tensors[:count], tensors[count:])
        return tuple(gradient for gradient in found if gradient is not None)


def _stretched(info, tensors, dimensions):
    """Tangents [K, ...] of a batch of directions, as [batch * K, ...]."""
    rows = [tensor.expand(info.batch_size, *tensor.shape) if dimension is None else tensor.movedim(dimension, 0)
            for tensor, dimension in zip(tensors, dimensions)]
    return [row.flatten(0, 1) for row in rows]


@one_forward
class _Tangents(Derivative):
    """(tangents [K, ...] of the tensors with these numbers, all tensors) to the images' tangents, [K, ...]."""

    @staticmethod
    def forward(call, numbers, *tensors):
        return _tensor(call.rendered.tangents({i: _arrays.to_numpy(tensor) for i, tensor in zip(numbers, tensors)}))

    @staticmethod
    def vmap(info, dimensions, call, numbers, *tensors):
        rows = _stretched(info, tensors[:len(numbers)], dimensions[2:])
        images = _Tangents.apply(call, numbers, *rows, *tensors[len(numbers):])
        return images.unflatten(0, (info.batch_size, -1)), 0


class _OfOneCall(torch.autograd.Function):
    """One whose arguments are not batched: its derivatives may be."""

    @staticmethod
    def vmap(info, dimensions, *inputs):
        raise NotImplementedError("dpr: error: torch.func.vmap (dpr.render): got a batch of arguments, expected a batch of "
                                  "directions or gradients: a call takes N views, shapes or meshes")


@one_forward
class _Render(_OfOneCall):
    @staticmethod
    def forward(call, *tensors):
        call.rendered = Rendered(call.spec, [_arrays.to_numpy(tensor) for tensor in tensors], call.wanted)
        return tuple(_tensor(array) for array in call.rendered.outputs)

    @staticmethod
    def setup_context(ctx, inputs, outputs):
        ctx.call, *tensors = inputs
        ctx.set_materialize_grads(False)
        ctx.save_for_backward(*tensors)  # so that a change in place is noticed
        ctx.save_for_forward(*tensors)
        ctx.mark_non_differentiable(*(outputs[i] for i in ctx.call.rendered.constants(ctx.call.wanted)))

    @staticmethod
    def backward(ctx, *grads):
        tensors = ctx.saved_tensors
        if all(grad is None for grad in grads):
            return (None,) * (1 + len(tensors))
        found = dict(zip(ctx.call.wanted, _Gradients.apply(ctx.call, len(grads), *grads, *tensors)))
        return (None, *(found.get(i) for i in range(len(tensors))))

    @staticmethod
    def jvp(ctx, _, *tangents):
        if ctx.call.spec.outputs and not _HAS_CONTEXT:
            _arrays.fail(ValueError, "outputs", repr(ctx.call.spec.outputs[0]), "none in forward mode with PyTorch before 2.0, "
                         "which has no outputs without tangents")
        numbers = tuple(i for i, tangent in enumerate(tangents) if tangent is not None)
        images = _Tangents.apply(ctx.call, numbers, *(tangents[i][None] for i in numbers), *ctx.saved_tensors)
        return (images[0], *(None for _ in ctx.call.spec.outputs))


@one_forward
class _SampleTangents(Derivative):
    """(tangents [K, ...] of the tensors with these numbers, all tensors) to those of barycentrics and depth, [K, ...]."""

    @staticmethod
    def forward(rasterized, numbers, *tensors):
        given = {i: _arrays.to_numpy(tensor) for i, tensor in zip(numbers, tensors)}
        return tuple(_tensor(found) for found in rasterized.tangents(given))

    @staticmethod
    def vmap(info, dimensions, rasterized, numbers, *tensors):
        count = len(numbers)
        found = _SampleTangents.apply(rasterized, numbers, *_stretched(info, tensors[:count], dimensions[2:]), *tensors[count:])
        return tuple(tensor.unflatten(0, (info.batch_size, -1)) for tensor in found), (0, 0)


@one_forward
class _ImageTangents(Derivative):
    """(tangents [K, ...] of the values and of the tensors with these numbers, the values, all tensors) to those of the
    images, [K, ...]."""

    @staticmethod
    def forward(rasterized, numbers, moved, *tensors):
        given = {i: _arrays.to_numpy(tensor) for i, tensor in zip(numbers, tensors)}
        values = _arrays.to_numpy(tensors[len(numbers)])
        return _tensor(rasterized.resolve_tangents(len(moved), values, _arrays.to_numpy(moved), given))

    @staticmethod
    def vmap(info, dimensions, rasterized, numbers, moved, *tensors):
        count = len(numbers)
        rows = _stretched(info, (moved, *tensors[:count]), dimensions[2:])
        images = _ImageTangents.apply(rasterized, numbers, *rows, *tensors[count:])
        return images.unflatten(0, (info.batch_size, -1)), 0


@one_forward
class _SampleGradients(Derivative):
    """(gradients of barycentrics and depth, all tensors) to those of the wanted tensors."""

    @staticmethod
    def forward(call, grad_barycentrics, grad_depth, *tensors):
        found = call.rendered.gradients((None, grad_barycentrics, grad_depth))
        return tuple(_tensor(found[i]) for i in call.wanted)


@one_forward
class _ResolveGradients(Derivative):
    """(gradient of the images, the values, all tensors) to those of the values and of the wanted tensors."""

    @staticmethod
    def forward(rasterized, grad_images, values, *tensors):
        grad_values, found = rasterized.resolve_gradients(_arrays.to_numpy(values), _arrays.to_numpy(grad_images))
        return tuple(_tensor(array) for array in (grad_values, *(found[i] for i in rasterized.leaves)))


class _Rasterize(_OfOneCall):
    """(tensors of a call) to nothing: leaves the frame to the call. For torch.func, whose tensors have memory in here alone."""

    @staticmethod
    def forward(call, *tensors):
        call.rendered = Rasterized(call.spec, [_arrays.to_numpy(tensor) for tensor in tensors], call.wanted)
        return torch.empty(0)

    @staticmethod
    def setup_context(ctx, inputs, output):
        ctx.mark_non_differentiable(output)

    @staticmethod
    def jvp(ctx, *_):
        return None


@one_forward
class _Read(_OfOneCall):
    """(tensors of a call) to face_id, barycentrics and depth of its frame."""

    @staticmethod
    def forward(call, *tensors):
        return tuple(_tensor(array) for array in call.rendered.outputs)

    @staticmethod
    def setup_context(ctx, inputs, outputs):
        ctx.call, *tensors = inputs
        ctx.save_for_backward(*tensors)
        ctx.save_for_forward(*tensors)
        ctx.mark_non_differentiable(outputs[0])

    @staticmethod
    def backward(ctx, _, *grads):
        tensors = ctx.saved_tensors
        found = dict(zip(ctx.call.wanted, _SampleGradients.apply(ctx.call, *grads, *tensors)))
        return (None, *(found.get(i) for i in range(len(tensors))))

    @staticmethod
    def jvp(ctx, _, *tangents):
        if not _HAS_CONTEXT:
            _arrays.fail(ValueError, "tangents", "some, with PyTorch before 2.0, which has no outputs without tangents",
                         "none, or those of Samples.jvp()", "dpr.rasterize")
        numbers = tuple(i for i in ctx.call.wanted if tangents[i] is not None)  # 2.15 fills those of others
        found = _SampleTangents.apply(ctx.call.rendered, numbers, *(tangents[i][None] for i in numbers), *ctx.saved_tensors)
        return (None, *(tangent[0] for tangent in found))


@one_forward
class _Resolve(_OfOneCall):
    """(values of the samples, tensors of the call) to images."""

    @staticmethod
    def forward(rasterized, values, *tensors):
        return _tensor(rasterized.resolve(_arrays.to_numpy(values)))

    @staticmethod
    def setup_context(ctx, inputs, outputs):
        ctx.rasterized, *tensors = inputs
        ctx.save_for_backward(*tensors)
        ctx.save_for_forward(*tensors)

    @staticmethod
    def backward(ctx, grad_images):
        tensors = ctx.saved_tensors
        grad_values, *found = _ResolveGradients.apply(ctx.rasterized, grad_images, *tensors)
        found = dict(zip(ctx.rasterized.leaves, found))
        return (None, grad_values, *(found.get(i) for i in range(len(tensors) - 1)))

    @staticmethod
    def jvp(ctx, _, moved, *tangents):
        numbers = tuple(i for i in ctx.rasterized.leaves if tangents[i] is not None)
        values = ctx.saved_tensors[0]
        moved = torch.zeros_like(values) if moved is None else moved
        images = _ImageTangents.apply(ctx.rasterized, numbers, moved[None], *(tangents[i][None] for i in numbers),
                                      *ctx.saved_tensors)
        return images[0]


def rasterize(spec, leaves, copy):
    """(Rasterized, what reads its outputs, the tensors that resolve() depends on)"""
    tensors = [leaf if isinstance(leaf, torch.Tensor) else torch.from_dlpack(_arrays.to_numpy(leaf)) for leaf in leaves]
    if copy:
        tensors = [tensor.cpu() for tensor in tensors]
    call = _Call(spec, tuple(i for i, tensor in enumerate(tensors) if _is_wanted(tensor)))
    _Rasterize.apply(call, *tensors) if _HAS_CONTEXT else _Rasterize.forward(call, *tensors)
    return call.rendered, functools.lru_cache(None)(lambda: _Read.apply(call, *tensors)), tensors


def resolve(rasterized, values, tensors):
    return _Resolve.apply(rasterized, values, *tensors)


def _is_wanted(tensor):
    return tensor.requires_grad or forward_ad.unpack_dual(tensor).tangent is not None


def render(spec, leaves, copy):
    """(outputs, warning)"""
    home = next(leaf.device for leaf in leaves if isinstance(leaf, torch.Tensor))
    tensors = [leaf if isinstance(leaf, torch.Tensor) else torch.from_dlpack(_arrays.to_numpy(leaf)) for leaf in leaves]
    if copy:
        tensors = [tensor.cpu() for tensor in tensors]
    if is_compiling():
        wanted = [i for i, tensor in enumerate(tensors) if tensor.requires_grad]
        outputs, warning = torch.ops.dpr.render(tensors, wanted, _text_of(spec))[:-1], None
    else:
        call = _Call(spec, tuple(i for i, tensor in enumerate(tensors) if _is_wanted(tensor)))
        outputs = _Render.apply(call, *tensors)
        warning = call.rendered.warning
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
        found = _gradients(rendered, [all_grads.get(i) for i in range(1 + len(rendered.spec.outputs))], tensors)
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
