"""Faces cut smaller where a lens bends their edges."""
import torch

from . import _arguments


class Subdivision:
    """A mesh whose faces were cut, and how.

    faces    [F', 3], int64: the pieces, indices of the new vertices
    face_of  [F'], int64: the face that each is a piece of; face_of[face_id] is the old one
    texcoords  [F', 3, 2]: those of the pieces' corners, with gradients of the given ones; None without any
    """

    def __init__(self, faces, face_of, vertices_of, vertex_weights, of):
        self.faces, self.face_of = faces, face_of
        self._vertices_of, self._vertex_weights = vertices_of, vertex_weights
        self._old_vertices, self._old_faces = of
        self.texcoords = None

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

    def of_corners(self, values, old_faces):
        """What corners of the old faces [F, 3] have, [F, 3, C], at the pieces' corners: [F', 3, C].

        A weighted sum of the values at the corners of the same old face, so that seams between faces stay.
        """
        weights = self._corner_weights(old_faces.cpu()).to(values)
        return torch.einsum("fkc,fcd->fkd", weights, values[self.face_of.to(values.device)])

    def _corner_weights(self, old_faces):
        """[F', 3, 3]: of each corner of a piece, by the corners of the face that it was cut from."""
        of, weights = self._vertices_of[self.faces], self._vertex_weights[self.faces]  # [F', 3, 3], by old vertices
        corners = old_faces[self.face_of]  # [F', 3]
        # A face that names a vertex twice has it at the first of its corners.
        same = of[..., None] == corners[:, None, None, :]
        first = same & (same.cumsum(-1) == 1)
        return (weights[..., None] * first).sum(2)


def _require_rows(values, count, each):
    if values.dim() < 2 or values.shape[-2] != count:
        _arguments.fail(ValueError, "values (of a subdivision)", list(values.shape),
                        f"[{count}, C] or [N, {count}, C], a row for {each} of the mesh that was cut")
