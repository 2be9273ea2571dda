"""Least squares of images, from their tangents."""
import numbers
from typing import Any, Optional, Tuple

import numpy as np

from . import _arrays
from ._losses import alike

_WHERE = "dpr.normal_equations"


def normal_equations(tangents: Any, residuals: Any, weights: Optional[Any] = None) -> Tuple[Any, Any]:
    """(J^T W J [K, K], J^T W r [K]): Gauss-Newton's step x of parameters solves J^T W J x = -J^T W r.

    tangents   [K, ...], derivatives of the residuals along K directions, as Renderer.jvp() has those of images
    residuals  [...], such as image - target
    weights    of the residuals' squares, of a shape that broadcasts to theirs; 1 without

    Arrays of NumPy, PyTorch or JAX; sums are in their type. Costs 2 K^2 operations a residual. Raises ValueError for
    tangents of another shape than the residuals', weights whose shape does not broadcast to it, and weights below 0, but
    for these not while JAX traces.
    """
    weights = np.asarray(weights, np.float32) if isinstance(weights, numbers.Real) else weights
    given = {"tangents": tangents, "residuals": residuals, **({} if weights is None else {"weights": weights})}
    given = {name: _arrays.from_numbers(array) for name, array in given.items()}
    for name, array in given.items():
        _arrays.require_array(name, array, _WHERE)
    kinds = set(map(_arrays.type_of, given.values()))
    if len(kinds) > 1:
        kind = "float64" if "float64" in kinds else "float32"
        given = {name: _arrays.as_type(array, kind) for name, array in given.items()}
    tangents, residuals, *weights = alike(given, _WHERE)
    shape = tuple(residuals.shape)
    if len(tangents.shape) == 0 or tuple(tangents.shape[1:]) != shape:
        _arrays.fail(ValueError, "tangents", list(tangents.shape), f"[K, {', '.join(map(str, shape))}]", _WHERE)
    rows = tangents.reshape(tangents.shape[0], -1)
    weighted = (tangents * _checked(*weights, shape)).reshape(rows.shape) if weights else rows
    return weighted @ rows.T, weighted @ residuals.reshape(-1)


def _checked(weights, shape):
    own = tuple(weights.shape)
    if len(own) > len(shape) or any(size not in (1, of) for size, of in zip(own[::-1], shape[::-1])):
        _arrays.fail(ValueError, "weights", list(own), f"what broadcasts to {list(shape)}", _WHERE)
    known = _arrays.known(weights)
    if known is not None and not (known >= 0).all():
        _arrays.fail(ValueError, "weights", "numbers below 0", "numbers of at least 0", _WHERE)
    return weights
