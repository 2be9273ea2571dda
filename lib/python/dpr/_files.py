"""Files of meshes and images."""
import ctypes
import os
from typing import Any, Dict, Optional, Sequence, Union

import numpy as np

from . import _arrays, _frames, _library

Array = Any
_TYPES = (ctypes.c_float, ctypes.c_int32, ctypes.c_int64)


def _copied(array):
    """Indices become int64, by which tensors too can be indexed."""
    shape = tuple(array.shape[:array.dimensions])
    kind = _TYPES[array.element]
    values = np.ctypeslib.as_array(ctypes.cast(array.data, ctypes.POINTER(kind)), shape).copy()
    return values if kind is ctypes.c_float else values.astype(np.int64)


def read_mesh(file: Union[str, "os.PathLike[str]"]) -> Dict[str, Any]:
    """Arguments of render() for the mesh of a file: OBJ, PLY, OFF, STL, glTF or GLB.

        mesh = dpr.read_mesh("spot.obj")
        image = dpr.render(**mesh, views=views, intrinsics=intrinsics, width=256, height=256)

    vertices [V, 3] in object space and faces [F, 3], and what the file has of colors [V, 3] or face_colors [F, 3],
    opacities [V] or face_opacities [F], texcoords [T, 2] with face_texcoords [F, 3], textures (a list of [H, W, 3],
    linear RGB, or with opacity [H, W, 4]), wrap and filter (a list of words), face_textures [F], materials and
    face_materials [F]: NumPy's float32 and int64, as Renderer has them. Polygons become fans of triangles. A
    UserWarning tells what is left out. Raises OSError (dpr.IoError) where the file is missing or malformed,
    ValueError (dpr.InvalidArgument) where it cannot be rendered.
    """
    handle = ctypes.c_void_p()
    _library.call("dpr_mesh_file_read", os.fsencode(file), ctypes.byref(handle))
    try:
        contents = _library.MeshContents(size=ctypes.sizeof(_library.MeshContents))
        _library.call("dpr_mesh_file_contents", handle, ctypes.byref(contents))
        mesh, textures, materials = {}, [], {}
        for array in contents.arrays[:contents.array_count]:
            kind, _, name = array.name.decode().partition(".")
            if kind.startswith("textures["):
                textures.append(_copied(array))
            elif kind == "materials":
                materials[name] = _copied(array)
            else:
                mesh[kind] = _copied(array)
        if textures:
            mesh["textures"] = textures
        if materials:
            mesh["materials"] = materials
        for text in contents.settings[:contents.setting_count]:
            name, _, words = text.decode().partition("=")
            mesh[name] = words.split(",")
        for note in contents.notes[:contents.note_count]:
            _library.warn("dpr: " + note.decode(errors="replace"))
    finally:
        _library.library.dpr_mesh_file_destroy(handle)
    return mesh


@_arrays.named("dpr.write_mesh")
def write_mesh(file: Union[str, "os.PathLike[str]"], vertices: Array, faces: Array, *, colors: Optional[Array] = None,
               face_colors: Optional[Array] = None, opacities: Optional[Array] = None,
               face_opacities: Optional[Array] = None, texcoords: Optional[Array] = None,
               face_texcoords: Optional[Array] = None, textures: Any = None, face_textures: Optional[Array] = None,
               wrap: Union[str, Sequence[str]] = "repeat", filter: Union[str, Sequence[str]] = "bilinear",
               materials: Any = None, face_materials: Optional[Array] = None) -> None:
    """Writes a mesh as OBJ, PLY or GLB, by the extension, whole or not at all.

    The arguments are those of one mesh, as Renderer has them. GLB alone takes textures, which become PNG, sRGB in 8
    bits; texcoords go without them too, but not into PLY; OBJ has no face_colors; PLY's colours are bytes, clamped to
    [0, 1] as texels are. GLB numbers vertices anew, in the order of the faces, and has none that no face uses.
    Materials and opacities are left out, with a UserWarning. Raises OSError (dpr.IoError) where the file cannot be
    written, ValueError (dpr.InvalidArgument) for what it cannot hold.
    """
    for what, left_out in (("materials", (materials, face_materials)), ("opacities", (opacities, face_opacities))):
        if any(array is not None for array in left_out):
            _library.warn(f"dpr: {file} is written without {what}")
    named = {"vertices": vertices, "faces": faces, "colors": colors, "face_colors": face_colors, "texcoords": texcoords,
             "face_texcoords": face_texcoords, "face_textures": face_textures}
    textures = [] if textures is None else textures if isinstance(textures, (list, tuple)) else [textures]
    named.update((f"textures[{i}]", texture) for i, texture in enumerate(textures))
    packed = []
    for name, array in named.items():
        if array is not None:
            is_indices = name.startswith("face") and name != "face_colors"
            array = _arrays.converted(name, _arrays.from_numbers(array, is_indices), is_indices, "dpr.write_mesh")
            packed.append((name, np.ascontiguousarray(_arrays.to_numpy(array))))
    words = [(name, [value] if isinstance(value, str) else list(value)) for name, value in (("wrap", wrap), ("filter", filter))]
    settings = [f"{name}={','.join(value)}" for name, value in words] if textures else []
    _library.call("dpr_mesh_file_write", os.fsencode(file), *_frames.c_arrays(packed), *_frames.words(settings))


def read_image(file: Union[str, "os.PathLike[str]"], *, encoding: str = "srgb") -> Array:
    """Pixels of an image: NumPy's float32 [H, W, 4], linear RGB and alpha, row 0 on top; alpha 1 where the file has none.

    encoding  of files of 8 or 16 bits: "srgb", which becomes linear, or "linear", which is taken as it is (normal maps)

    EXR, PNG, JPEG and what else OpenImageIO knows; read_image(file)[..., :3] is a texture, and with [None] in front what
    render() returns. Raises OSError (dpr.IoError) where the file is missing, malformed or not finite.
    """
    handle = ctypes.c_void_p()
    _library.call("dpr_image_file_read", os.fsencode(file), encoding.encode(), ctypes.byref(handle))
    try:
        pixels = _library.Array()
        _library.call("dpr_image_file_pixels", handle, ctypes.byref(pixels))
        return _copied(pixels)
    finally:
        _library.library.dpr_image_file_destroy(handle)


def write_image(file: Union[str, "os.PathLike[str]"], pixels: Array, *, encoding: str = "srgb") -> None:
    """Writes linear RGB [H, W, 3], or with alpha [H, W, 4], by the extension, whole or not at all: .exr keeps the floats;
    .png, .tif, .tga, .jpg, .bmp and .ppm clamp to [0, 1] and have 8 bits, encoded as read_image() has it. Viewers blend
    by alpha what render() has blended already: give them image[0, ..., :3]. Raises OSError (dpr.IoError) where the file
    cannot be written, ValueError for another shape."""
    pixels = _arrays.to_numpy(_arrays.converted("pixels", _arrays.from_numbers(pixels), False, "dpr.write_image"))
    if pixels.ndim != 3 or pixels.shape[-1] not in (3, 4):
        _arrays.fail(ValueError, "pixels", list(pixels.shape), "[H, W, 3] or [H, W, 4]", "dpr.write_image")
    if pixels.shape[-1] == 3:
        pixels = np.concatenate([pixels, np.ones_like(pixels[..., :1])], -1)
    pixels = np.ascontiguousarray(pixels)
    _library.call("dpr_image_file_write", os.fsencode(file), encoding.encode(), _frames.c_arrays([("pixels", pixels)])[0])
