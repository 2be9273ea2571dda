"""Faces cut smaller where a lens bends their edges."""
import numpy as np

from . import _arrays, _frames


class Subdivision:
    """A mesh whose faces were cut, and how. Its arrays are of the library of the vertices that were cut.

    faces    [F', 3], int64: the pieces, indices of the new vertices
    face_of  [F'], int64: the face that each is a piece of; face_of[face_id] is the old one
    texcoords  [F', 3, 2]: those of the pieces' corners, with gradients of the given ones; None without any
    """

    def __init__(self, spec, named, tolerance, home):
        self._cut = _frames.Cut(spec, named, tolerance)
        arrays = dict(named)
        self._old_faces, self._old_vertices = arrays["faces"], len(arrays["vertices"])
        self.faces, self.face_of = (_arrays.like(home, array) for array in (self._cut.faces, self._cut.face_of))
        self.texcoords = None

    def of_vertices(self, values):
        """Values of vertices, [V, C] or [N, V, C], such as positions, at the new vertices: [V', C] or [N, V', C].

        A weighted sum of old values, through which gradients flow back to them.
        """
        _require_rows(values, self._old_vertices, "a vertex")
        first, second, third = (
            values[..., _arrays.like(values, np.ascontiguousarray(self._cut.vertices_of[:, k])), :]
            * _arrays.like(values, np.ascontiguousarray(self._cut.vertex_weights[:, k, None])) for k in range(3))
        return first + second + third

    def of_faces(self, values):
        """Values of faces, [F, C] or [N, F, C], at the pieces: [F', C] or [N, F', C]."""
        _require_rows(values, len(self._old_faces), "a face")
        return values[..., _arrays.like(values, self._cut.face_of), :]

    def of_corners(self, values):
        """Values of the old faces' corners, [F, 3, C], at the pieces' corners: [F', 3, C].

        A weighted sum of the values at the corners of the same old face, so that seams between faces stay.
        """
        weights = _arrays.like(values, self._corner_weights())
        return (weights[..., None] * values[_arrays.like(values, self._cut.face_of)][:, None]).sum(2)

    def _corner_weights(self):
        """[F', 3, 3]: of each corner of a piece, by the corners of the face that it was cut from."""
        cut = self._cut
        of, weights = cut.vertices_of[cut.faces], cut.vertex_weights[cut.faces]  # [F', 3, 3], by old vertices
        corners = self._old_faces[cut.face_of]  # [F', 3]
        # A face that names a vertex twice has it at the first of its corners.
        same = of[..., None] == corners[:, None, None, :]
        first = same & (same.cumsum(-1) == 1)
        return (weights[..., None] * first).sum(2, dtype=np.float32)


def _require_rows(values, count, each):
    if len(values.shape) < 2 or values.shape[-2] != count:
        _arrays.fail(ValueError, "values (of a subdivision)", list(values.shape),
                     f"[{count}, C] or [N, {count}, C], a row for {each} of the mesh that was cut")


def corner_texcoords(texcoords, face_texcoords, faces, vertex_count):
    """[F, 3, 2] of texture coordinates, however they were given: of vertices, of corners, or by indices."""
    count, shape = len(faces), tuple(texcoords.shape)
    if face_texcoords is None:
        if shape == (count, 3, 2):
            return texcoords
        if shape != (vertex_count, 2):
            _arrays.fail(ValueError, "texcoords", list(shape), f"[{vertex_count}, 2] or [{count}, 3, 2]")
        indices = faces
    else:
        if len(shape) != 2 or shape[1] != 2:
            _arrays.fail(ValueError, "texcoords", list(shape), "[T, 2]")
        indices = _arrays.to_numpy(_arrays.converted("face_texcoords", face_texcoords, True))
        if indices.shape != (count, 3):
            _arrays.fail(ValueError, "face_texcoords", list(indices.shape), [count, 3])
    if count and not 0 <= indices.min() <= indices.max() < shape[0]:
        _arrays.fail(ValueError, "face_texcoords", f"indices {indices.min()} to {indices.max()}",
                     f"0 to {shape[0] - 1}, of texcoords")
    return texcoords[_arrays.like(texcoords, indices.astype(np.int64))]
