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
        fail(TypeError, name, str(tensor.dtype).replace("torch.", ""), f"float32; {name}.float() has its gradients too")
    if not any(_fits(tensor.shape, shape) for shape in shapes):
        texts = ["[" + ", ".join(str(size) for size in shape) + "]" for shape in shapes]
        fail(ValueError, name, list(tensor.shape), " or ".join(texts))
    return tensor


def indices(faces, copy):
    """int64 faces [F, 3] on the CPU."""
    faces = _on_cpu("faces", faces, copy)
    if faces.dtype not in (torch.int64, torch.int32):
        fail(TypeError, "faces", str(faces.dtype).replace("torch.", ""), "int64 or int32, indices of vertices")
    if not _fits(faces.shape, ("F", 3)):
        fail(ValueError, "faces", list(faces.shape), "[F, 3], a list of such, or [N, F, 3] padded with -1")
    return faces.long()


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
        return torch.empty(0), []
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


def lists_of_padded(vertices, faces, colors, face_colors):
    """A padded batch as lists: views of the tensors, through which gradients flow."""
    face_counts = [int((mesh[:, 0] >= 0).sum()) for mesh in faces]
    meshes = [mesh[:count] for mesh, count in zip(faces, face_counts)]
    if any(bool((mesh < 0).any()) for mesh in meshes):
        fail(ValueError, "faces", "-1 in a face before a mesh's last one", "-1 behind it, as padding")
    vertex_counts = [int(mesh.max()) + 1 if len(mesh) else 0 for mesh in meshes]

    def cut(name, padded, counts):
        if padded is None:
            return None
        if len(padded) != len(counts):
            fail(ValueError, name, f"{len(padded)} in the first dimension", f"{len(counts)}, as faces are padded")
        return [mesh[:count] for mesh, count in zip(padded, counts)]

    return (cut("vertices", vertices, vertex_counts), meshes, cut("colors", colors, vertex_counts),
            cut("face_colors", face_colors, face_counts))
