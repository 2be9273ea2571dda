"""Attributes at samples, in PyTorch: by the library where a pass back is all that is asked for."""
import torch
from torch.autograd import forward_ad

from . import _arrays, _rasterized


class _Interpolate(torch.autograd.Function):
    """(formula, samples' faces, barycentrics, attributes, faces) to values. The formula is the same in PyTorch's operations."""

    @staticmethod
    def forward(ctx, mixed, *tensors):
        ctx.mixed = mixed
        ctx.save_for_backward(*tensors)
        return torch.from_numpy(_rasterized.interpolated(*map(_arrays.to_numpy, tensors)))

    @staticmethod
    def backward(ctx, grad):
        _, barycentrics, attributes, faces = ctx.saved_tensors
        wanted = ctx.needs_input_grad[2:4]
        if torch.is_grad_enabled():  # of a derivative that is to have one itself
            given = [tensor for tensor, is_wanted in zip((barycentrics, attributes), wanted) if is_wanted]
            found = iter(torch.autograd.grad(ctx.mixed(barycentrics, attributes, faces), given, grad, create_graph=True))
        else:
            arrays = map(_arrays.to_numpy, (*ctx.saved_tensors, grad))
            gradients = map(torch.from_numpy, _rasterized.interpolated_gradients(*arrays))
            found = iter([gradient for gradient, is_wanted in zip(gradients, wanted) if is_wanted])
        return (None, None, *(next(found) if is_wanted else None for is_wanted in wanted), None)


class _Covered(torch.autograd.Function):
    """(Rasterized, formula, faces or None, attributes, tensors of the call) to the values [M, C] of the samples with a face.
    The formula makes the same of the attributes in PyTorch's operations."""

    @staticmethod
    def forward(ctx, rasterized, mixed, faces, attributes, *tensors):
        ctx.rasterized, ctx.mixed, ctx.faces = rasterized, mixed, faces
        ctx.save_for_backward(attributes, *tensors)
        return torch.from_numpy(rasterized.interpolate(_arrays.to_numpy(attributes), faces))

    @staticmethod
    def backward(ctx, grad):
        attributes, *tensors = ctx.saved_tensors
        wanted = ctx.needs_input_grad[3:]
        if torch.is_grad_enabled():  # of a derivative that is to have one itself
            given = [tensor for tensor, is_wanted in zip((attributes, *tensors), wanted) if is_wanted]
            found = iter(torch.autograd.grad(ctx.mixed(attributes), given, grad, create_graph=True, allow_unused=True))
            return (None, None, None, *(next(found) if is_wanted else None for is_wanted in wanted))
        of_attributes, found = ctx.rasterized.interpolate_gradients(_arrays.to_numpy(attributes), ctx.faces,
                                                                    _arrays.to_numpy(grad))
        of_tensors = (torch.from_numpy(found[i]) if i in found else None for i in range(len(tensors)))
        return (None, None, None, torch.from_numpy(of_attributes), *of_tensors)


def is_transformed(*tensors):
    """Within torch.func, or with tangents: the library knows nothing of these."""
    peek = getattr(getattr(torch._C, "_functorch", None), "peek_interpreter_stack", None)
    return peek is not None and peek() is not None or \
        any(forward_ad.unpack_dual(tensor).tangent is not None for tensor in tensors)


def interpolate(face_id, barycentrics, attributes, faces, mixed):
    if is_transformed(barycentrics, attributes):
        return mixed(barycentrics, attributes, faces)
    return _Interpolate.apply(mixed, face_id, barycentrics, attributes, faces)


def interpolate_covered(rasterized, mixed, faces, attributes, tensors):
    if is_transformed(attributes, *tensors):
        return mixed(attributes)
    return _Covered.apply(rasterized, mixed, faces, attributes, *tensors)
