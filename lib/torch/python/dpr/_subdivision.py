"""Faces cut smaller where a lens bends their edges."""
import torch


class Subdivision:
    """A mesh whose faces were cut, and how.

    faces    [F', 3], int64: the pieces, indices of the new vertices
    face_of  [F'], int64: the face that each is a piece of; face_of[face_id] is the old one
    """

    def __init__(self, faces, face_of, vertices_of, vertex_weights):
        self.faces, self.face_of = faces, face_of
        self._vertices_of, self._vertex_weights = vertices_of, vertex_weights

    def of_vertices(self, values):
        """What vertices have, [V, C] or [N, V, C], positions and colours say, at the new ones: [V', C] or [N, V', C].

        A weighted sum of old values, through which gradients flow back to them.
        """
        weights = self._vertex_weights.to(values)
        first, second, third = (values[..., self._vertices_of[:, k].to(values.device), :] * weights[:, k, None]
                                for k in range(3))
        return first + second + third

    def of_faces(self, values):
        """What faces have, [F, C] or [N, F, C], at the pieces: [F', C] or [N, F', C]."""
        return values[..., self.face_of.to(values.device), :]
