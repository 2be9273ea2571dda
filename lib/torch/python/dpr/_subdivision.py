"""Faces cut smaller where a lens bends their edges."""
from . import _arguments


class Subdivision:
    """A mesh whose faces were cut, and how.

    faces    [F', 3], int64: the pieces, indices of the new vertices
    face_of  [F'], int64: the face that each is a piece of; face_of[face_id] is the old one
    """

    def __init__(self, faces, face_of, vertices_of, vertex_weights, of):
        self.faces, self.face_of = faces, face_of
        self._vertices_of, self._vertex_weights = vertices_of, vertex_weights
        self._old_vertices, self._old_faces = of

    def of_vertices(self, values):
        """What vertices have, [V, C] or [N, V, C], positions and colours say, at the new ones: [V', C] or [N, V', C].

        A weighted sum of old values, through which gradients flow back to them.
        """
        _require_rows(values, self._old_vertices, "a vertex")
        weights = self._vertex_weights.to(values)
        first, second, third = (values[..., self._vertices_of[:, k].to(values.device), :] * weights[:, k, None]
                                for k in range(3))
        return first + second + third

    def of_faces(self, values):
        """What faces have, [F, C] or [N, F, C], at the pieces: [F', C] or [N, F', C]."""
        _require_rows(values, self._old_faces, "a face")
        return values[..., self.face_of.to(values.device), :]


def _require_rows(values, count, each):
    if values.dim() < 2 or values.shape[-2] != count:
        _arguments.fail(ValueError, "values (of a subdivision)", list(values.shape),
                        f"[{count}, C] or [N, {count}, C], a row for {each} of the mesh that was cut")
