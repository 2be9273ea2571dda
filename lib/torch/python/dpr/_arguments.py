"""Checks of arguments, and what becomes of them: tensors that the operators take."""
import torch


def fail(error, name, got, expected):
    raise error(f"dpr: error: {name} (dpr.render): got {got}, expected {expected}")


def _fits(shape, expected):
    return len(shape) == len(expected) and all(isinstance(e, str) or s == e for s, e in zip(shape, expected))


def _on_cpu(name, tensor, copy):
    if not isinstance(tensor, torch.Tensor):
        fail(TypeError, name, type(tensor).__name__, "a tensor")
    if tensor.device.type == "cpu":
        return tensor
    if not copy:
        fail(ValueError, name, f"a tensor on {tensor.device}",
             "one on the CPU, as OpenCL does not reach PyTorch's memory elsewhere; copy=True copies tensors and images")
    return tensor.cpu()


def floats(name, tensor, shapes, copy):
    """The tensor on the CPU, if it is float32 and has one of the shapes, in which words stand for any size."""
    tensor = _on_cpu(name, tensor, copy)
    if tensor.dtype != torch.float32:
        hint = f"; {name}.float() has its gradients too" if tensor.is_floating_point() else ""
        fail(TypeError, name, str(tensor.dtype).replace("torch.", ""), "float32" + hint)
    if not any(_fits(tensor.shape, shape) for shape in shapes):
        texts = ["[" + ", ".join(str(size) for size in shape) + "]" for shape in shapes]
        fail(ValueError, name, list(tensor.shape), " or ".join(texts))
    return tensor


def indices(name, tensor, shape, copy):
    """int64 on the CPU, of a shape in which words stand for any size."""
    tensor = _on_cpu(name, tensor, copy)
    if tensor.dtype not in (torch.int64, torch.int32):
        fail(TypeError, name, str(tensor.dtype).replace("torch.", ""), "int64 or int32, indices")
    if not _fits(tensor.shape, shape):
        expected = "[" + ", ".join(str(size) for size in shape) + "]"
        fail(ValueError, name, list(tensor.shape), f"{expected}, a list of such, or padded ones with -1 behind")
    return tensor.long()


def dictionary(name, given):
    """The dictionary, or an empty one for None."""
    if given is not None and not isinstance(given, dict):
        fail(TypeError, name, type(given).__name__, "a dictionary")
    return given or {}


def number(name, value):
    """A setting's value, which has no gradient."""
    if not isinstance(value, torch.Tensor):
        return value
    if value.requires_grad:
        fail(ValueError, name, "a tensor that requires a gradient", "a value without one: only sigma, gamma and alpha "
             "of a call, the tensors of meshes and cameras, background and lights have gradients")
    return value.item()


def lights(given, kinds, copy):
    """(all numbers in one tensor, the count of harmonics and of each kind's lights); no counts without lights."""
    if given is None:
        return torch.empty(0, dtype=torch.float32), []
    names = ["ambient", "harmonics", *kinds]
    for name in given:
        if name not in names:
            fail(ValueError, "lights", repr(name), ", ".join(names[:-1]) + " or " + names[-1])
    ambient = given.get("ambient")
    parts = [torch.full((3,), 0.5) if ambient is None else floats("lights.ambient", ambient, [(3,)], copy)]
    counts = []
    for name, shape in [("harmonics", (9, 3)), *((kind, ("L", size)) for kind, size in kinds.items())]:
        tensor = given.get(name)
        if tensor is None:
            counts.append(0)
            continue
        tensor = floats(f"lights.{name}", tensor, [shape], copy)
        counts.append(tensor.shape[0])
        parts.append(tensor.flatten())
    return torch.cat(parts), counts
