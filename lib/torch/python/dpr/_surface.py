"""Textures and materials as arguments, and as what the operators take."""
import torch

from . import _arguments


def _texcoords(mesh, faces, vertex_count, copy):
    """([T, 2], face_texcoords [F, 3], which are empty where they are the faces)."""
    given, of_faces = mesh["texcoords"], mesh["face_texcoords"]
    nothing = torch.empty(0, dtype=torch.int64)
    if given is None:
        if of_faces is not None:
            _arguments.fail(ValueError, "face_texcoords", "them alone", "them beside texcoords")
        return torch.empty(0, dtype=torch.float32), nothing
    count = faces.shape[0]
    if of_faces is not None:
        of_faces = _arguments.indices("face_texcoords", of_faces, (count, 3), copy)
        return _arguments.floats("texcoords", given, [("T", 2)], copy), of_faces
    texcoords = _arguments.floats("texcoords", given, [(vertex_count, 2), (count, 3, 2)], copy)
    if texcoords.dim() == 2:
        return texcoords, nothing
    return texcoords.reshape(-1, 2), torch.arange(3 * count).view(count, 3)


def corner_texcoords(texcoords, face_texcoords, faces, vertex_count, copy):
    """[F, 3, 2], however they were given; None for None."""
    values, indices = _texcoords({"texcoords": texcoords, "face_texcoords": face_texcoords}, faces, vertex_count, copy)
    if texcoords is None:
        return None
    if indices.numel() and not 0 <= indices.min() <= indices.max() < len(values):
        _arguments.fail(ValueError, "face_texcoords", f"indices {indices.min()} to {indices.max()}",
                        f"0 to {len(values) - 1}, of texcoords")
    return values[indices if indices.numel() else faces]


def _textures(given, copy):
    """(all texels [..., 3] one texture after the other, height and width of each)."""
    given = listed(given)
    images = [_arguments.floats(f"textures[{i}]", texture, [("H", "W", 3)], copy) for i, texture in enumerate(given)]
    sizes = [size for image in images for size in image.shape[:2]]
    return torch.cat([torch.empty(0, 3, dtype=torch.float32)] + [image.reshape(-1, 3) for image in images]), sizes


def listed(given):
    """A texture, or a word, as a list of one."""
    if given is None:
        return []
    return list(given) if isinstance(given, (list, tuple)) else [given]


def _words(name, given):
    words = listed(given)
    for word in words:
        if not isinstance(word, str):
            _arguments.fail(TypeError, name, repr(word), "a word, or a list of one a texture")
    return words


def _materials(given, copy):
    """(specular [M, 3], shininess [M] or none)."""
    given = _arguments.dictionary("materials", given)
    for name in given:
        if name not in ("specular", "shininess"):
            _arguments.fail(ValueError, "materials", repr(name), "specular or shininess")
    specular, shininess = given.get("specular"), given.get("shininess")
    if specular is not None:
        specular = _arguments.floats("materials.specular", specular, [("M", 3)], copy)
    count = "M" if specular is None else specular.shape[0]
    if shininess is None:
        nothing = torch.empty(0, dtype=torch.float32)
        return nothing if specular is None else specular, nothing
    shininess = _arguments.floats("materials.shininess", shininess, [(count,)], copy)
    if specular is None:
        specular = torch.ones(shininess.shape[0], 3, dtype=torch.float32)
    return specular, shininess


def pack(mesh, faces, vertex_count, copy):
    """A mesh's numbers [texcoords, texels, specular, shininess], its indices, and (sizes, wraps, filters) of its
    textures."""
    texcoords, face_texcoords = _texcoords(mesh, faces, vertex_count, copy)
    texels, sizes = _textures(mesh["textures"], copy)
    of_faces = [torch.empty(0, dtype=torch.int64) if mesh[name] is None else
                _arguments.indices(name, mesh[name], (faces.shape[0],), copy)
                for name in ("face_textures", "face_materials")]
    words = [_words(name, mesh[name]) for name in ("wrap", "filter")]
    return [texcoords, texels, *_materials(mesh["materials"], copy)], [face_texcoords, *of_faces], (sizes, *words)
