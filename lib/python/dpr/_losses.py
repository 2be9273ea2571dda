"""Losses of a mesh's shape, and of sets of points."""
import numbers
import sys
from typing import Any, Optional

import numpy as np

from . import _arrays

Array = Any
_LEAST = 1e-30  # of a squared length, whose root has no derivative at 0


def _length(vectors):
    return (vectors * vectors).sum(-1).clip(_LEAST) ** 0.5


def _mean(values):
    """Of the last axis; 0 of none. NumPy's quotients of two numbers are not of their type."""
    return (values / max(values.shape[-1], 1)).sum(-1)


def _like(array, values):
    """The same numbers for the array's library."""
    values = np.asarray(values, np.float32)
    return sys.modules["torch"].as_tensor(values).to(array) if _arrays.module_of(array) == "torch" else values


def alike(named, where):
    """Arrays, by name, that go together: tensors, or arrays of JAX and NumPy, by the first that is a tensor or JAX's. Fails
    for a tensor whose gradient would be lost."""
    home = next((array for array in named.values() if _arrays.module_of(array) in ("torch", "jax")), None)
    kind, found = _arrays.module_of(home), []
    for name, array in named.items():
        if home is not None and _arrays.module_of(array) not in (kind, "numpy"):
            if getattr(array, "requires_grad", False):
                _arrays.fail(ValueError, name, "a tensor that requires a gradient", "one without beside JAX's arrays", where)
            array = _arrays.to_numpy(array)
        is_moved = kind == "torch" and _arrays.module_of(array) == "numpy"
        found.append(sys.modules["torch"].as_tensor(array).to(home) if is_moved else array)
    return found


def _cross(a, b):
    """The arrays' libraries have it by different names."""
    return a[..., [1, 2, 0]] * b[..., [2, 0, 1]] - a[..., [2, 0, 1]] * b[..., [1, 2, 0]]


def _hinges(edge_of_side, across):
    """(edges [H], corners across from them [H, 2]) of every two sides of one edge."""
    order = np.argsort(edge_of_side, kind="stable")
    edge_of_side, across = edge_of_side[order], across[order]
    edges, corners = [np.empty(0, np.int64)], [np.empty((0, 2), np.int64)]
    step = 1
    while step < len(order):
        is_pair = edge_of_side[step:] == edge_of_side[:-step]
        if not is_pair.any():
            break
        edges.append(edge_of_side[step:][is_pair])
        corners.append(np.stack([across[:-step][is_pair], across[step:][is_pair]], -1))
        step += 1
    return np.concatenate(edges), np.concatenate(corners)


def sum_at(values, indices, count):
    """[..., count, 3]: sums of the rows of values [..., n, 3] that have the same index."""
    kind, shape = _arrays.module_of(values), (*values.shape[:-2], count, values.shape[-1])
    if kind == "torch":
        indices = sys.modules["torch"].as_tensor(indices, device=values.device)
        return values.new_zeros(shape).index_add(-2, indices, values)
    if kind == "jax":
        return sys.modules["jax"].numpy.zeros(shape, values.dtype).at[..., indices, :].add(values)
    sums = np.zeros(shape, values.dtype)
    np.add.at(sums, (..., indices, slice(None)), values)
    return sums


class MeshLoss:
    """Terms that keep a mesh smooth while images shape it, as dpr::MeshLoss (dpr/mesh_loss.hpp) has them.

    faces  [F, 3], of any triangles: a vertex' ring is every other vertex of its faces, a hinge every two faces that share
           an edge

    The terms take vertices [V, 3] or [N, V, 3] of NumPy, PyTorch or JAX, and return one number, or N, of their type. Those of
    PyTorch and JAX have derivatives. Raises ValueError for other shapes.
    """

    def __init__(self, faces: Array):
        faces = _arrays.to_numpy(_arrays.converted("faces", _arrays.from_numbers(faces, True), True, "dpr.MeshLoss"))
        faces = faces.astype(np.int64)
        if faces.ndim != 2 or faces.shape[-1] != 3 or (faces.size and faces.min() < 0):
            _arrays.fail(ValueError, "faces", list(faces.shape), "[F, 3], indices from 0 on", "dpr.MeshLoss")
        self._vertices = int(faces.max()) + 1 if faces.size else 0
        sides, across = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), -1), faces[:, [2, 0, 1]].reshape(-1)
        is_edge = sides[:, 0] != sides[:, 1]
        self._edges, edge_of_side = np.unique(sides[is_edge], axis=0, return_inverse=True)
        edges, self._across = _hinges(edge_of_side.reshape(-1), across[is_edge])
        self._hinges = self._edges[edges]
        self._degrees = np.bincount(self._edges.ravel(), minlength=self._vertices)

    def laplacian(self, vertices: Array) -> Array:
        """Sum over vertices of the squared distance to the mean of their ring, eq. (77)."""
        self._require(vertices)
        a, b = self._edges.T
        count = vertices.shape[-2]
        sums = sum_at(vertices[..., b, :], a, count) + sum_at(vertices[..., a, :], b, count)
        degrees = np.zeros((count, 1), np.float32)
        degrees[:self._vertices, 0] = self._degrees
        has_ring, divisor = _like(vertices, degrees > 0), _like(vertices, np.maximum(degrees, 1))
        shift = (vertices - sums / divisor) * has_ring
        return (shift * shift).sum(-1).sum(-1)

    def edge_length(self, vertices: Array, target: float = 0.0) -> Array:
        """Mean over edges of (length - target)^2."""
        self._require(vertices)
        a, b = self._edges.T
        return _mean((_length(vertices[..., a, :] - vertices[..., b, :]) - target) ** 2)

    def normal_consistency(self, vertices: Array) -> Array:
        """Mean over hinges of 1 - cos of the angle between the normals; hinges with a face without area have 0."""
        return self._of_hinges(vertices, lambda bend: bend)

    def flatness(self, vertices: Array) -> Array:
        """Mean over hinges of (1 - cos)^2, as SoftRas flattens."""
        return self._of_hinges(vertices, lambda bend: bend * bend)

    def _of_hinges(self, vertices, term):
        self._require(vertices)
        start, end = (vertices[..., self._hinges[:, i], :] for i in (0, 1))
        edge = end - start
        a = _cross(edge, vertices[..., self._across[:, 0], :] - start)
        b = _cross(vertices[..., self._across[:, 1], :] - start, edge)
        has_area = ((a * a).sum(-1) > _LEAST) & ((b * b).sum(-1) > _LEAST)
        bend = (1 - (a / _length(a)[..., None] * (b / _length(b)[..., None])).sum(-1)) * has_area
        return _mean(term(bend))

    def _require(self, vertices):
        shape = list(getattr(vertices, "shape", ()))
        if len(shape) not in (2, 3) or shape[-1] != 3 or shape[-2] < self._vertices:
            _arrays.fail(ValueError, "vertices", shape or type(vertices).__name__,
                         f"[V, 3] or [N, V, 3], V at least {self._vertices}", "dpr.MeshLoss")


def _constant(array):
    """(module with functions of arrays, the values without derivatives): JAX's own, also while it traces."""
    if _arrays.module_of(array) == "jax":
        jax = sys.modules["jax"]
        return jax.numpy, jax.lax.stop_gradient(array)
    return np, _arrays.to_numpy(array)


def sample_points(vertices: Array, faces: Array, count: int, seed: Optional[int] = None) -> Array:
    """Points of a mesh's surface, uniform by area: [count, 3], of vertices [V, 3] and faces [F, 3]. With PyTorch and JAX a
    function of the vertices. seed: of NumPy's generator; other points every time without. Raises ValueError for other
    shapes and indices, and for a surface without area, but for this not while JAX traces."""
    where = "dpr.sample_points"
    vertices, faces = _arrays.from_numbers(vertices), _arrays.from_numbers(faces, True)
    _arrays.require_array("vertices", vertices, where)
    faces = _arrays.to_numpy(_arrays.converted("faces", faces, True, where)).astype(np.int64)
    for name, array, expected in (("vertices", vertices, "[V, 3]"), ("faces", faces, "[F, 3]")):
        if len(array.shape) != 2 or array.shape[1] != 3:
            _arrays.fail(ValueError, name, list(array.shape), expected, where)
    if faces.size and not (faces.min() >= 0 and faces.max() < vertices.shape[0]):
        _arrays.fail(ValueError, "faces", f"indices from {faces.min()} to {faces.max()}",
                     f"indices from 0 to {vertices.shape[0] - 1}, of vertices", where)
    if not (isinstance(count, numbers.Integral) and count >= 0):
        _arrays.fail(ValueError, "count", repr(count), "a whole number, at least 0", where)
    lib, values = _constant(vertices)
    values = values.astype(np.float64) if lib is np else values
    a, b, c = (values[faces[:, k]] for k in range(3))
    sums = lib.cumsum((_cross(b - a, c - a) ** 2).sum(-1) ** 0.5)
    if lib is np and not (len(faces) and 0 < sums[-1] < np.inf):
        _arrays.fail(ValueError, "vertices", "a surface without area", "finite vertices and faces", where)
    random = np.random.default_rng(seed)
    chosen = lib.searchsorted(sums, random.random(count) * sums[-1], side="right").clip(0, len(faces) - 1)
    root, along = random.random((count, 1)) ** 0.5, random.random((count, 1))
    weights = np.concatenate([1 - root, root * (1 - along), root * along], 1)[..., None]
    corners = _arrays.rows(vertices, lib.asarray(faces)[chosen].reshape(-1)).reshape(count, 3, 3)
    return (corners * _like(vertices, weights)).sum(-2)


def _nearest(lib, points, others):
    """[N] indices of the others; O(N M) time."""
    squares = (others * others).sum(-1)
    return lib.concatenate([(squares - 2 * points[first:first + 1024] @ others.T).argmin(-1)
                            for first in range(0, len(points), 1024)])


def chamfer(points: Array, others: Array) -> Array:
    """Mean squared distance of points [N, 3] to their nearest of the others [M, 3], and the reverse, added up. With PyTorch
    and JAX a function of both. O(N M). Raises ValueError for other shapes."""
    points, others = _arrays.from_numbers(points), _arrays.from_numbers(others)
    for name, array in (("points", points), ("others", others)):
        _arrays.require_array(name, array, "dpr.chamfer")
        if len(array.shape) != 2 or array.shape[-1] != 3 or not array.shape[0]:
            _arrays.fail(ValueError, name, list(array.shape), "[N, 3], N at least 1", "dpr.chamfer")
    points, others = alike({"points": points, "others": others}, "dpr.chamfer")
    (lib, values), (other_lib, other_values) = _constant(points), _constant(others)
    if lib is not other_lib:
        lib = lib if lib is not np else other_lib
        points, others = lib.asarray(points), lib.asarray(others)  # NumPy's take no indices that JAX traces
    middle = (other_values.min(0) + other_values.max(0)) / 2  # far from the origin squares have too few digits
    values, other_values = (lib.asarray(own - middle, np.float32) for own in (values, other_values))
    there = points - others[_nearest(lib, values, other_values)]
    back = others - points[_nearest(lib, other_values, values)]
    return (there * there).sum(-1).mean() + (back * back).sum(-1).mean()
