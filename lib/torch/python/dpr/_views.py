"""What views have in common, and what each has by itself."""
import torch

from . import _arguments, _surface


def _light_dimensions(name):
    return 1 if name == "ambient" else 2


def _has_views(tensor, dimensions):
    return isinstance(tensor, torch.Tensor) and tensor.dim() == dimensions + 1


def _of_each(name, tensor, dimensions, count):
    """A list of every view's own, or of what they have in common."""
    if not _has_views(tensor, dimensions):
        return [tensor] * count
    if tensor.shape[0] != count:
        _arguments.fail(ValueError, name, list(tensor.shape), f"{count} in the first dimension, one a view")
    return list(tensor.unbind())


def are_own(textures, lights):
    """Whether views have textures or lights of their own."""
    return any(_has_views(texture, 3) for texture in _surface.listed(textures)) or \
        any(_has_views(tensor, _light_dimensions(name))
            for name, tensor in _arguments.dictionary("lights", lights).items())


def lights_of_each(lights, count):
    """A dictionary a view."""
    if lights is None:
        return [None] * count
    parts = {name: _of_each(f"lights.{name}", tensor, _light_dimensions(name), count)
             for name, tensor in _arguments.dictionary("lights", lights).items()}
    return [{name: tensors[i] for name, tensors in parts.items()} for i in range(count)]


def meshes_of_each(mesh, count):
    """A mesh in several views as lists of one a view."""
    lists = {name: [value] * count for name, value in mesh.items()}
    for name in ("vertices", "colors", "face_colors"):
        tensor = mesh[name]
        shared = tensor[0] if _has_views(tensor, 2) and tensor.shape[0] == 1 else tensor
        lists[name] = _of_each(name, shared, 2, count)
    textures = [_of_each("textures", texture, 3, count) for texture in _surface.listed(mesh["textures"])]
    lists["textures"] = [[of_views[i] for of_views in textures] for i in range(count)]
    return lists


def lists_of_meshes(meshes, count):
    """The same of meshes that are lists already. Words and materials may be those of all."""
    lists = {}
    for name, given in meshes.items():
        shared = given is None or isinstance(given, (str, dict))
        if shared:
            given = [given] * count
        if name == "textures" and _has_views(given, 3):
            given = list(given.unbind())
        if not isinstance(given, (list, tuple)) or len(given) != count:
            got = f"{len(given)} meshes" if isinstance(given, (list, tuple)) else type(given).__name__
            _arguments.fail(ValueError, name, got, f"a list of {count}, one a view, as faces are a list")
        lists[name] = list(given)
    return lists


def lists_of_padded(meshes):
    """A padded batch as lists: views of the tensors, through which gradients flow."""
    vertices, faces = meshes["vertices"], meshes["faces"]
    face_counts = [int((mesh[:, 0] >= 0).sum()) for mesh in faces]
    of_faces = [mesh[:count] for mesh, count in zip(faces, face_counts)]
    if any(bool((mesh < 0).any()) for mesh in of_faces):
        _arguments.fail(ValueError, "faces", "-1 in a face before a mesh's last one", "-1 behind it, as padding")
    vertex_counts = [int(mesh.max()) + 1 if len(mesh) else 0 for mesh in of_faces]

    def cut(name, counts):
        padded = meshes[name]
        if not isinstance(padded, torch.Tensor):
            return padded
        if len(padded) != len(counts):
            _arguments.fail(ValueError, name, f"{len(padded)} in the first dimension",
                            f"{len(counts)}, as faces are padded")
        return [mesh[:count] for mesh, count in zip(padded, counts)]

    lists = {**meshes, "faces": of_faces}
    for name in ("vertices", "colors"):
        lists[name] = cut(name, vertex_counts)
    for name in ("face_colors", "face_texcoords", "face_textures", "face_materials"):
        lists[name] = cut(name, face_counts)
    texcoords = meshes["texcoords"]
    if isinstance(texcoords, torch.Tensor) and texcoords.dim() == 4:  # of corners
        lists["texcoords"] = cut("texcoords", face_counts)
    else:
        of_vertices = meshes["face_texcoords"] is None
        lists["texcoords"] = cut("texcoords", vertex_counts if of_vertices else [None] * len(faces))
    return lists
