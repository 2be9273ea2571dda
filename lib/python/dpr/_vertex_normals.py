"""Normals of vertices, in PyTorch: by the library where a pass back is all that is asked for."""
import numpy as np
import torch

from . import _arrays, _frames, _library
from ._interpolate import is_transformed


def _call(function, vertices, faces, *others):
    """The array like the vertices that a function of the library fills."""
    vertices, *others = (np.ascontiguousarray(_arrays.to_numpy(tensor)) for tensor in (vertices, *others))
    found = np.empty(vertices.shape, np.float32)
    named = _frames.c_arrays([("vertices", vertices), ("faces", np.ascontiguousarray(_arrays.to_numpy(faces)))])
    _library.call(function, *named, *(_frames.c_arrays([("normals", other)])[0] for other in (*others, found)))
    return torch.from_numpy(found)


class _VertexNormals(torch.autograd.Function):
    """(formula, vertices, faces) to normals. The formula is the same in PyTorch's operations."""

    @staticmethod
    def forward(ctx, formula, vertices, faces):
        ctx.formula = formula
        ctx.save_for_backward(vertices, faces)
        return _call("dpr_vertex_normals", vertices, faces)

    @staticmethod
    def backward(ctx, grad):
        vertices, faces = ctx.saved_tensors
        if torch.is_grad_enabled():  # of a derivative that is to have one itself
            return None, *torch.autograd.grad(ctx.formula(vertices, faces), vertices, grad, create_graph=True), None
        return None, _call("dpr_vertex_normals_backward", vertices, faces, grad), None


def vertex_normals(formula, vertices, faces):
    is_plain = vertices.dtype is torch.float32 and faces.dtype in (torch.int32, torch.int64)
    if not is_plain or _arrays.is_compiling() or is_transformed(vertices):
        return formula(vertices, faces)
    return _VertexNormals.apply(formula, vertices, faces)
