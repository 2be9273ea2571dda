"""Arguments of a call as a list of arrays, and how frames are made of them."""
import difflib
import math
import numbers

import numpy as np

from . import _arrays, _library
from ._arrays import fail
from ._frames import OTHERS, WITH_GRADIENTS, Spec
from ._merged import require_padding

_FLOATS = ("vertices", "colors", "face_colors", "opacities", "face_opacities", "texcoords")
_INDICES = ("faces", "face_texcoords", "face_textures", "face_materials")
_BLUR = "a number of pixels above 0"
_EUCLIDEAN = ("opendr", "nmr")
"""Presets with distances in NDC, not squared."""


def dictionary(name, given):
    """The dictionary, or an empty one for None."""
    if given is not None and not isinstance(given, dict):
        fail(TypeError, name, type(given).__name__, "a dictionary")
    for key in given or {}:
        if not str(key).isidentifier():
            fail(ValueError, name, repr(key), "names")
    return given or {}


def listed(given):
    """A texture, or a word, as a list of one."""
    if given is None:
        return []
    return list(given) if isinstance(given, (list, tuple)) else [given]


def _has_views(array, dimensions):
    return _arrays.is_array(array) and len(array.shape) == dimensions + 1


def _light_dimensions(name):
    return 1 if name == "ambient" else 2


def _of_view(name, array, dimensions, view, count):
    """A view's own, or what views have in common."""
    if not _has_views(array, dimensions):
        return array
    if array.shape[0] != count:
        fail(ValueError, name, list(array.shape), f"{count} in the first dimension, one a view")
    return _Row(array, view, None)


def setting(name, value):
    """"sigma=0.001", of a value that has no gradient."""
    if _arrays.is_array(value):
        if getattr(value, "requires_grad", False):
            fail(ValueError, name, "a tensor that requires a gradient", "a value without one: only sigma, gamma and "
                 "alpha of a call, the tensors of meshes and cameras, background and lights have gradients")
        value = value.item()
    return f"{name}={value}"


def pixels(name, value):
    if not isinstance(value, numbers.Real):
        fail(TypeError, name, repr(value), "a whole number of pixels")
    if not value % 1 == 0:
        fail(_library.InvalidArgument, name, value, "a whole number of pixels")
    return int(value)


def device_name(device):
    if not isinstance(device, (str, numbers.Integral)):
        fail(TypeError, "device", repr(device), "a name, or a number of dpr.devices()")
    return str(device)


def require_names(given, known):
    """Fails for a keyword that there is not, and tells the nearest, or all where none is near."""
    for name in given:
        if name not in known:
            near = difflib.get_close_matches(name, known, 1)
            fail(InvalidName, "name", f'"{name}"', f"a name that there is; did you mean '{near[0]}'?" if near else
                 "one of " + ", ".join(dict.fromkeys(known)))


def power_of_blur(renderer_settings, width, height):
    """(scale, power): sigma, in the unit of the settings' distances, is (scale * blur)**power of a blur in pixels."""
    distance = renderer_settings.get("distance")
    if distance is None:
        distance = "euclidean" if renderer_settings.get("preset") in _EUCLIDEAN else "squared"
    return 2 / max(min(width, height), 1), 1 if distance == "euclidean" else 2


def sigma_of_blur(blur, scale, power):
    if not isinstance(blur, numbers.Real) or isinstance(blur, bool):
        fail(TypeError, "blur", repr(blur), _BLUR)
    if not 0 < blur < math.inf:
        fail(_library.InvalidArgument, "blur", blur, _BLUR)
    return (scale * blur) ** power


class InvalidName(_library.InvalidArgument, TypeError):
    """A keyword that there is not."""


class _Row:
    """A view's part of an array: a row, or the beginning of one. No list, which textures may be."""

    def __init__(self, array, row, count):
        self.array, self.row, self.count = array, row, count


class Plan:
    """The arrays of a call, `leaves`, each once, as they were `given`, where, `paths`, and the frames made of them."""

    def __init__(self, copy):
        self.copy, self.leaves, self.given, self.paths, self.parts = copy, [], [], [], []
        self.slopes = {}  # functions that compute derivatives of leaves by what was given, by the leaves' numbers

    def add(self, path, array, indices=False, which=()):
        """(number, row, count) of an array that was given at the path, ("lights", "point") say; `which` is the index of
        its mesh in a list."""
        row = count = None
        array = _arrays.from_numbers(array, indices)
        if isinstance(array, _Row):
            array, row, count = array.array, array.row, array.count
        else:
            path = (*path[:1], *which, *path[1:])
        if path in self.paths:  # of another view
            return self.paths.index(path), row, count
        words = [str(key) for key in path if not isinstance(key, int)]
        name = ".".join(words) + (f"[{path[-1]}]" if words == ["textures"] else "")
        leaf = _arrays.converted(name, array, indices)
        _arrays.require_on_cpu(name, array, self.copy)
        self.leaves.append(leaf)
        self.given.append(array)
        self.paths.append(path)
        return len(self.leaves) - 1, row, count

    def add_camera(self, views, intrinsics):
        """The same of both; what has no first dimension, of views, gets one."""
        found = self.add(("views",), views), self.add(("intrinsics",), intrinsics)
        for (number, _, _), dimensions in zip(found, (3, 2)):
            if len(self.leaves[number].shape) == dimensions - 1:
                self.leaves[number] = _arrays.batched(self.leaves[number])
        return found

    def repeat(self, number, count):
        """Makes an array of one view one of as many."""
        if count != 1 and tuple(self.leaves[number].shape[:1]) == (1,):
            self.leaves[number] = _arrays.repeated(self.leaves[number], count)

    def repeat_camera(self, camera, count=None):
        """The same of both, as add_camera() returns them: of so many views, or as many as the other has."""
        numbers = [number for number, _, _ in camera]
        if count is None:
            count = max((self.leaves[number].shape[0] for number in numbers if self.leaves[number].shape), default=1)
        for number in numbers:
            self.repeat(number, count)

    def blur_to_sigma(self, number, scale, power):
        blur = self.leaves[number]
        known = _arrays.known(blur)
        if known is not None and not ((known > 0) & (known < math.inf)).all():
            fail(_library.InvalidArgument, "blur", known.tolist(), _BLUR)
        if _arrays.module_of(blur) not in ("torch", "jax"):
            blur = _arrays.to_numpy(blur)
        sigma = (scale * blur) ** power
        self.leaves[number] = sigma if _arrays.is_array(sigma) else np.asarray(sigma)
        self.leaves[number] = _arrays.as_type(self.leaves[number], "float32")
        self.slopes[number] = lambda: power * scale * (scale * _arrays.to_numpy(blur)) ** (power - 1)

    def mesh(self, mesh, which=()):
        """{name of an array of a frame: (number, row, count)} of a mesh, by the index `which` of a list of meshes; none
        of a mesh without faces."""
        found = {}
        for name in (*_FLOATS, *_INDICES):
            if mesh[name] is not None or name in ("vertices", "faces"):
                found[name] = self.add((name,), mesh[name], name in _INDICES, which)
        for i, texture in enumerate(listed(mesh["textures"])):
            found[f"textures[{i}]"] = self.add(("textures", i), texture, which=which)
        for name, array in dictionary("materials", mesh["materials"]).items():
            if array is not None:
                found[f"materials.{name}"] = self.add(("materials", name), array, which=which)
        faces, _, count = found["faces"]
        rows = self.leaves[faces].shape[0] if count is None and self.leaves[faces].shape else count
        return {} if rows == 0 else found

    def frame(self, frame, arrays, wrap, filter):
        """One more frame, of {name: (number, row, count)}."""
        for name, given in (("wrap", listed(wrap)), ("filter", listed(filter))):
            for word in given:
                if not isinstance(word, str):
                    fail(TypeError, name, repr(word), "a word, or a list of one a texture")
                if not word.isalpha():
                    fail(ValueError, name, repr(word), "a word")
            if given and "textures[0]" in arrays:
                self.parts.append(f"{frame}|{name}={','.join(given)}")
        for name, (leaf, row, count) in arrays.items():
            self.parts.append(f"{frame}|{name}|{leaf}|{'' if row is None else row}|{'' if count is None else count}")


def _meshes_of_each(mesh, count):
    """A mesh in several views as lists of one a view."""
    lists = {name: [value] * count for name, value in mesh.items()}
    for name in ("vertices", "colors", "face_colors"):
        array = mesh[name]
        if _has_views(array, 2) and array.shape[0] == 1:
            lists[name] = [_Row(array, 0, None)] * count
        else:
            lists[name] = [_of_view(name, array, 2, i, count) for i in range(count)]
    textures = listed(mesh["textures"])
    lists["textures"] = [[_of_view("textures", texture, 3, i, count) for texture in textures] for i in range(count)]
    return lists


def _lists_of_meshes(meshes, views):
    """The same of meshes that are lists already. Words, materials and a texture may be those of all, a mesh that of all
    views."""
    lists, count = {}, 1 if len(meshes["faces"]) == 1 else views
    for name, given in meshes.items():
        is_of_all = name == "textures" and _arrays.is_array(given) and len(given.shape) == 3
        if given is None or isinstance(given, (str, dict)) or is_of_all:
            given = [given] * count
        if name == "textures" and _has_views(given, 3):
            given = [_Row(given, i, None) for i in range(given.shape[0])]
        if not isinstance(given, (list, tuple)) or len(given) != count:
            got = f"{len(given)} meshes" if isinstance(given, (list, tuple)) else type(given).__name__
            fail(ValueError, name, got, f"a list of {count}, one a view, as faces are a list")
        lists[name] = list(given) * (views if count == 1 else 1)
    return lists


def _lists_of_padded(meshes):
    """A padded batch as lists of the rows' beginnings."""
    faces = _arrays.to_numpy(_arrays.converted("faces", meshes["faces"], True))
    require_padding(faces)
    face_counts = [int((mesh[:, 0] >= 0).sum()) for mesh in faces]
    of_faces = [mesh[:count] for mesh, count in zip(faces, face_counts)]
    vertex_counts = [int(mesh.max()) + 1 if len(mesh) else 0 for mesh in of_faces]
    texcoords = meshes["texcoords"]
    if _has_views(texcoords, 3):  # of corners
        of_texcoords = face_counts
    else:
        of_texcoords = vertex_counts if meshes["face_texcoords"] is None else [None] * len(faces)
    counts = {"vertices": vertex_counts, "colors": vertex_counts, "opacities": vertex_counts, "texcoords": of_texcoords,
              **dict.fromkeys(("faces", "face_colors", "face_opacities", "face_texcoords", "face_textures",
                               "face_materials"), face_counts)}
    lists = dict(meshes)
    for name, of_meshes in counts.items():
        padded = meshes[name]
        if not _arrays.is_array(padded):
            continue
        if padded.shape[0] != len(of_meshes):
            fail(ValueError, name, f"{padded.shape[0]} in the first dimension", f"{len(of_meshes)}, as faces are padded")
        lists[name] = [_Row(padded, i, count) for i, count in enumerate(of_meshes)]
    return lists


def _from_lists(mesh):
    """The mesh, or meshes, with arrays where lists of numbers were given."""
    mesh = {name: _arrays.from_numbers(value, name in _INDICES) for name, value in mesh.items()}
    if isinstance(mesh["textures"], (list, tuple)):
        mesh["textures"] = [_arrays.from_numbers(texture) for texture in mesh["textures"]]
    faces, vertices = mesh["faces"], mesh["vertices"]
    if isinstance(vertices, (list, tuple)) and _arrays.is_array(faces) and not _has_views(faces, 2):
        mesh["faces"] = [faces] * len(vertices)
    return mesh


def _count_views(cameras, mesh, lights):
    """Number of views: of the cameras, or where there is one, of meshes, shapes, colours, textures or lights."""
    faces = mesh["faces"]
    counts = [array.shape[0] for array in cameras if array.shape]
    if isinstance(faces, (list, tuple)):
        counts.append(len(faces))
    arrays = [(mesh[name], 2) for name in ("faces", "vertices", "colors", "face_colors")]
    arrays += [(texture, 3) for texture in listed(mesh["textures"])]
    arrays += [(array, _light_dimensions(name)) for name, array in lights.items()]
    counts += [array.shape[0] for array, dimensions in arrays if _has_views(array, dimensions)]
    counts = [count for count in counts if count != 1]
    return counts[0] if counts else 1


def of_call(renderer, mesh, views, intrinsics, background, lights, smoothing, outputs, copy, as_one=False):
    """(Spec, Plan) of Renderer.__call__()'s arguments; smoothing: those of sigma, blur, gamma and alpha. as_one: faces
    [N, F, 3] are padded as one frame takes them."""
    known = [*WITH_GRADIENTS, *OTHERS]
    if not isinstance(outputs, (list, tuple, set, frozenset, dict)):
        fail(TypeError, "outputs", repr(outputs), "a list of names")
    for name in outputs:
        if name not in known:
            fail(ValueError, "outputs", repr(name), ", ".join(known[:-1]) + " or " + known[-1])
    mesh = _from_lists(mesh)
    if mesh["colors"] is not None and mesh["face_colors"] is not None:
        fail(ValueError, "colors", "colors and face_colors", "one of them")
    if smoothing["sigma"] is not None and smoothing["blur"] is not None:
        fail(ValueError, "blur", "blur and sigma", "one of them")
    plan, settings, shared, of_views = Plan(copy), list(renderer._texts), {}, {}
    of_views["views"], of_views["intrinsics"] = plan.add_camera(views, intrinsics)
    views, intrinsics = plan.leaves
    if len(views.shape) != 3:
        fail(_library.InvalidArgument, "views", list(views.shape), "[N, 4, 4] or [4, 4]")
    lights_given = {name: _arrays.from_numbers(array) for name, array in dictionary("lights", lights).items()}
    count = _count_views((views, intrinsics), mesh, lights_given)
    if len(intrinsics.shape) == 2:
        plan.repeat_camera(of_views.values(), count)
        views, intrinsics = plan.leaves
    if background is not None:
        shared["background"] = plan.add(("background",), background)
    of_blur = power_of_blur(renderer._settings, renderer.width, renderer.height)
    for name, value in smoothing.items():
        if _arrays.is_array(value):
            found = plan.add((name,), value)
            shared["sigma" if name == "blur" else name] = found
            if name == "blur":
                plan.blur_to_sigma(found[0], *of_blur)
        elif name == "blur" and value is not None:
            settings.append(setting("sigma", sigma_of_blur(value, *of_blur)))
        elif value is not None:
            settings.append(setting(name, value))

    if _has_views(mesh["faces"], 2) and not as_one:
        mesh = _lists_of_padded(mesh)
    if isinstance(mesh["faces"], (list, tuple)):
        lists = _lists_of_meshes(mesh, count)
    elif any(_has_views(texture, 3) for texture in listed(mesh["textures"])):
        lists = _meshes_of_each(mesh, count)
    else:
        lists = None
        of_lights = {f"lights.{name}": plan.add(("lights", name), array) for name, array in lights_given.items()
                     if array is not None}
        plan.frame(0, {**plan.mesh(mesh), **of_views, **of_lights, **shared}, mesh["wrap"], mesh["filter"])
    if lists is not None:
        if count == 0:
            fail(ValueError, "views", [0, 4, 4], "at least one view")
        if len(intrinsics.shape) != 2 or intrinsics.shape[0] != count:
            fail(ValueError, "intrinsics", list(intrinsics.shape), " or ".join(f"[{count}, {n}]" for n in (4, 9, 8, 1)))
        meshes = len(mesh["faces"]) if isinstance(mesh["faces"], (list, tuple)) else 0
        for i in range(count):
            own = {name: values[i] for name, values in lists.items()}
            arrays = plan.mesh(own, (i % meshes,) if meshes else ())
            for name, array in lights_given.items():
                if array is not None:
                    row = _of_view(f"lights.{name}", array, _light_dimensions(name), i, count)
                    arrays[f"lights.{name}"] = plan.add(("lights", name), row)
            for name, (leaf, _, _) in of_views.items():
                arrays[name] = (leaf, i, None)
            plan.frame(i, {**arrays, **shared}, own["wrap"], own["filter"])
    spec = Spec(renderer.device, renderer.width, renderer.height, int(lights is not None), tuple(settings),
                tuple(outputs), tuple(plan.parts))
    return spec, plan
