"""Unlike meshes of a call, each in its own view, side by side in one frame: one set of launches renders them all."""
import numpy as np

from . import _arrays

_OF_ALL = ("background", "sigma", "gamma", "alpha")
"""Arrays that are one for all views of a frame, as lights may be."""
_KNOWN = {"vertices", "faces", "views", "intrinsics", "colors", "face_colors", "opacities", "face_opacities", "texcoords",
          "face_texcoords", "face_textures", "materials.specular", "materials.shininess", "face_materials", *_OF_ALL}
_MOST_PADDING, _SMALL = 2, 4096
"""Times as many faces and vertices, with padding, as the meshes have, beyond so many."""
_MOST_PIXELS = 1 << 24
NO_MESH = {"vertices": np.zeros((1, 3), np.float32), "faces": np.zeros((1, 3), np.int64)}
"""Triangle without area, which is dropped: shows the background of a mesh without faces."""


def require_padding(faces):
    """Fails unless -1 is in the last rows of meshes' faces [N, F, 3] alone."""
    is_there = faces[..., 0] >= 0
    if (np.diff(is_there.astype(np.int8)) > 0).any() or (faces[is_there] < 0).any():
        _arrays.fail(ValueError, "faces", "-1 in a face before a mesh's last one", "-1 behind it, as padding")


def _is_of_all(part):
    return part.name in _OF_ALL or part.name.startswith("lights.") and part.row is None


def _split(settings):
    """{"wrap": [words], ...}"""
    return {name: words.split(",") for name, words in (text.split("=") for text in settings)}


def is_regular(mesh):
    """True if arrays are of the sizes that a frame takes, and indices within them: beside others nothing would tell."""
    vertices, faces = mesh["vertices"].size // 3, mesh["faces"].size // 3
    texcoords, textures, materials = mesh.get("texcoords"), _texture_count(mesh), _material_count(mesh)
    by_index = "face_texcoords" in mesh
    shapes = {"colors": (vertices, 3), "face_colors": (faces, 3), "opacities": (vertices,), "face_opacities": (faces,),
              "face_texcoords": (faces, 3), "face_textures": (faces,), "face_materials": (faces,),
              "materials.specular": (materials, 3), "materials.shininess": (materials,)}
    bounds = {"faces": vertices, "face_texcoords": 0 if texcoords is None else texcoords.size // 2,
              "face_textures": textures, "face_materials": materials}
    least = {"face_textures": -1}
    return (mesh["vertices"].shape[1:] == mesh["faces"].shape[1:] == (3,)
            and (texcoords is not None) == (textures > 0)
            and (texcoords is None or texcoords.shape in (((vertices, 2), (faces, 3, 2)) if not by_index else
                                                          ((texcoords.size // 2, 2),)))
            and all(mesh[name].shape == shape for name, shape in shapes.items() if name in mesh)
            and all(mesh[name].max() < bound and mesh[name].min() >= least.get(name, 0)
                    for name, bound in bounds.items() if name in mesh))


def _kind(settings, parts, mesh):
    """What frames must have in common to be one; None of one that stays alone, and of one that is to be refused by itself.
    mesh: the parts' arrays, by name"""
    textures = {name for name in mesh if name.startswith("textures[")}
    lights = {name for name in mesh if name.startswith("lights.")}
    if "faces" not in mesh or not mesh.keys() - textures - lights <= _KNOWN or not is_regular(mesh):
        return None
    names = mesh.keys() - textures - {"face_texcoords", "face_textures", "face_materials"}
    of_all = tuple(sorted(part for part in parts if _is_of_all(part)))
    most_channels = max((mesh[name].shape[-1] for name in textures), default=0)  # a fourth is opacity
    return frozenset(_split(settings)), most_channels, frozenset(names), of_all, frozenset((name, mesh[name].shape)
                                                                                           for name in lights)


def groups_of(spec, frames, arrays):
    """Lists of the numbers of frames, of (settings, parts), that are rendered as one."""
    alone = [[i] for i in range(len(frames))]
    # Noise that is drawn has the numbers of the views in the call.
    if len(frames) == 1 or any("monte_carlo" in text for text in spec.settings):
        return alone
    kinds = {}
    for i, (settings, parts) in enumerate(frames):
        mesh = {part.name: part.of(arrays[part.leaf]) for part in parts}
        kind, sizes = _kind(settings, parts, mesh), [mesh[name].size // 3 if name in mesh else 0 for name in ("faces", "vertices")]
        kinds.setdefault(i if kind is None else kind, []).append((*sizes, i))
    pixels = spec.width * spec.height
    return sorted(group for members in kinds.values() for group in groups_by_size(members, pixels))


def groups_by_size(meshes, pixels):
    """Lists of the numbers of meshes, of (faces, vertices, number), that are padded to the largest in images of so many
    pixels."""
    groups, faces, vertices, most = [[]], 0, 0, 0
    for mesh in sorted(meshes):
        group = [*groups[-1], mesh]
        faces, vertices, most = faces + mesh[0], vertices + mesh[1], max(most, mesh[1])
        fits = (len(group) * mesh[0] <= _SMALL + _MOST_PADDING * faces
                and len(group) * most <= _SMALL + _MOST_PADDING * vertices and len(group) * pixels <= _MOST_PIXELS)
        if fits or len(group) == 1:
            groups[-1] = group
        else:
            groups.append([mesh])
            faces, vertices, most = mesh[0], mesh[1], mesh[1]
    return [sorted(number for _, _, number in group) for group in groups]


class Single:
    """A frame's arrays as they are; `is_only`: the call has no other frame."""

    def __init__(self, settings, parts, arrays, is_only):
        self.settings, self.parts, self._is_only = settings, parts, is_only
        self.named = [(part.name, part.of(arrays[part.leaf])) for part in parts]

    def names(self, wanted):
        return [part.name for part in self.parts if part.leaf in wanted]

    def gradients(self, totals):
        """[(name, array to fill)]; the only frame fills the totals themselves."""
        own = [(part.name, part.of(totals[part.leaf])) for part in self.parts if part.leaf in totals]
        return own if self._is_only else [(name, np.empty_like(array)) for name, array in own]

    def add(self, found, totals):
        """Adds what gradients() gave, and was filled, to the totals."""
        if self._is_only:
            return
        parts = [part for part in self.parts if part.leaf in totals]
        for part, (_, array) in zip(parts, found):
            part.of(totals[part.leaf])[...] += array

    def tangents(self, given, count):
        """[(name, [count, ...])]"""
        named = []
        for part in self.parts:
            if part.leaf in given:
                tangent = given[part.leaf]
                own = tangent if part.row is None else np.stack([part.of(direction) for direction in tangent])
                named.append((part.name, own.reshape(count, -1)))
        return named


class Merged:
    """The arrays of several frames in those of one: vertices, faces and what is by these are padded to as many in every
    view, coordinates of textures, textures and materials follow one another."""

    def __init__(self, frames, arrays):
        """frames: (settings, parts) of each"""
        self._views = len(frames)
        self._places = []  # (part, name, its place in the array of that name)
        frames = [(settings, parts, {**NO_MESH, **{part.name: part.of(arrays[part.leaf]) for part in parts}})
                  for settings, parts in frames]
        self.settings = _settings_of_all(frames)
        meshes = [mesh for _, _, mesh in frames]
        self._vertices = max(mesh["vertices"].size // 3 for mesh in meshes)
        self._faces = max(mesh["faces"].size // 3 for mesh in meshes)
        self._shapes = {"vertices": (self._views, self._vertices, 3)}
        self._next = {"texcoords": 0, "textures": 0, "materials": 0}
        indices = []
        for view, (_, parts, mesh) in enumerate(frames):
            indices.append(self._indices(mesh))
            for part in parts:
                self._place(view, part, mesh)
            self._next["texcoords"] += mesh.get("texcoords", np.empty(0)).size // 2
            self._next["textures"] += _texture_count(mesh)
            self._next["materials"] += _material_count(mesh)
        self.named = [(name, np.stack([of_view[name] for of_view in indices])) for name in indices[0]]
        merged = self._room()
        for name in merged.keys() & {"opacities", "face_opacities"}:
            merged[name][...] = 1  # of what is padded too: outputs with gradients need opaque surfaces
        for part, name, place in self._places:
            own = part.of(arrays[part.leaf])
            merged[name][place] = own.reshape(merged[name][place].shape)
            if name == "vertices":  # others lie where the first does
                merged[name][place[0], place[1].stop:] = own.reshape(-1, 3)[:1]
        self.named += list(merged.items())

    def _indices(self, mesh):
        """Faces, and what they refer to, of a view."""
        faces = mesh["faces"].reshape(-1, 3).astype(np.int64)
        count = len(faces)
        found = {"faces": faces}
        if "texcoords" in mesh:
            corners = mesh.get("face_texcoords")
            if corners is None:
                of_corners = mesh["texcoords"].shape == (count, 3, 2)
                corners = np.arange(3 * count).reshape(-1, 3) if of_corners else faces
            found["face_texcoords"] = corners.reshape(-1, 3) + self._next["texcoords"]
            textures = mesh.get("face_textures", np.zeros(count, np.int64)).astype(np.int64)
            found["face_textures"] = np.where(textures < 0, textures, textures + self._next["textures"])
        if _material_count(mesh):
            found["face_materials"] = mesh.get("face_materials", np.zeros(count, np.int64)) + self._next["materials"]
        return {name: np.concatenate([rows, np.zeros((self._faces - count, *rows.shape[1:]), np.int64)])
                for name, rows in found.items()}

    def _place(self, view, part, mesh):
        """Where a part's numbers are, and how large their array is at least."""
        name, own = part.name, mesh[part.name]
        if name in ("faces", "face_texcoords", "face_textures", "face_materials"):
            return
        if _is_of_all(part):
            if view > 0:
                return
            place, shape = ..., own.shape
        elif name in ("views", "intrinsics"):
            place, shape = view, (self._views, *own.shape[1:])
        elif name.startswith("lights."):
            place, shape = view, (self._views, *own.shape)
        elif name in ("vertices", "colors", "face_colors", "opacities", "face_opacities"):
            most, per_row = self._faces if name.startswith("face_") else self._vertices, 1 if name.endswith("opacities") else 3
            place, shape = (view, slice(0, own.size // per_row)), (self._views, most) + (per_row,) * (per_row > 1)
        elif name.startswith("textures["):
            name, place, shape = f"textures[{self._next['textures'] + int(name[9:-1])}]", ..., own.shape
        else:
            per_row = {"texcoords": 2, "materials.specular": 3, "materials.shininess": 1}[name]
            first = self._next[name.split(".")[0]]
            rows = own.size // per_row
            place, shape = slice(first, first + rows), (first + rows,) + (per_row,) * (per_row > 1)
        self._shapes[name] = shape
        self._places.append((part, name, place))

    def _room(self, leaves=None):
        """{name: zeros} of arrays with numbers of these leaves, or of all."""
        wanted = self._shapes if leaves is None else {name for part, name, _ in self._places if part.leaf in leaves}
        return {name: np.zeros(shape, np.float32) for name, shape in self._shapes.items() if name in wanted}

    def names(self, wanted):
        return list(self._room(wanted))

    def gradients(self, totals):
        return list(self._room(totals).items())

    def add(self, found, totals):
        found = dict(found)
        for part, name, place in self._places:
            if part.leaf in totals:
                total = part.of(totals[part.leaf])
                total[...] += found[name][place].reshape(total.shape)

    def tangents(self, given, count):
        moved = {name: np.zeros((count, *array.shape), np.float32) for name, array in self._room(given).items()}
        for part, name, place in self._places:
            if part.leaf in given:
                for direction, tangent in zip(moved[name], given[part.leaf]):
                    direction[place] = part.of(tangent).reshape(direction[place].shape)
        return [(name, array.reshape(count, -1)) for name, array in moved.items()]


def _texture_count(mesh):
    return sum(name.startswith("textures[") for name in mesh)


def _settings_of_all(frames):
    """Words of textures: a word of every texture of every frame."""
    words = {}
    for settings, _, mesh in frames:
        for name, own in _split(settings).items():
            words.setdefault(name, []).extend(own * _texture_count(mesh) if len(own) == 1 else own)
    return [f"{name}={','.join(own)}" for name, own in words.items()]


def _material_count(mesh):
    specular, shininess = mesh.get("materials.specular"), mesh.get("materials.shininess")
    return specular.size // 3 if specular is not None else 0 if shininess is None else shininess.size
