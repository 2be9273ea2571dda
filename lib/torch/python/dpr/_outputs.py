"""What images show beside colours."""
import torch

from . import _arguments

_CHANNELS = {"depth": 1, "position": 3, "normal": 3, "texcoords": 2}
"""Outputs with gradients, and how many numbers a pixel of theirs has."""
_OTHERS = ("face_id", "barycentrics", "uv", "effective_faces")
_LEAST_WEIGHT = 1e-12


def _divided(name, rgba):
    """[..., channels] from sums over the faces, weight times value, and of their weights."""
    values = rgba[..., :_CHANNELS[name]]
    sums = torch.linalg.vector_norm(values, dim=-1, keepdim=True) if name == "normal" else rgba[..., 3:]
    is_seen = (rgba[..., 3:] > _LEAST_WEIGHT) & (sums > _LEAST_WEIGHT)
    values = torch.where(is_seen, values / torch.where(is_seen, sums, torch.ones_like(sums)), torch.zeros_like(values))
    return values[..., 0] if name == "depth" else values


def of_frame(frame, names, inputs, smoothing_names, size):
    """{name: tensor}. `inputs`: those that such outputs depend on, in the order of dpr::_attributes; `size`: views,
    height and width."""
    known = [*_CHANNELS, *_OTHERS]
    for name in names:
        if name not in known:
            _arguments.fail(ValueError, "outputs", repr(name), ", ".join(known[:-1]) + " or " + known[-1])
    smooth = [name for name in names if name in _CHANNELS]
    others = [name for name in names if name in _OTHERS]
    found = {}
    if smooth:
        wanted = [tensor.requires_grad for tensor in inputs]
        images = torch.ops.dpr._attributes(frame, smooth, inputs, smoothing_names, wanted, *size)
        found = {name: _divided(name, image) for name, image in zip(smooth, images)}
    if others:
        found.update(zip(others, torch.ops.dpr._auxiliary(frame, others, *size)))
    return {name: found[name] for name in names}
