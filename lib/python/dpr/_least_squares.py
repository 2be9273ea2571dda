"""Least squares of images, from their tangents."""
from typing import Any, Optional, Tuple

from . import _arrays


def normal_equations(tangents: Any, residuals: Any, weights: Optional[Any] = None) -> Tuple[Any, Any]:
    """(J^T W J [K, K], J^T W r [K]): Gauss-Newton's step x of parameters solves J^T W J x = -J^T W r.

    tangents   [K, ...], derivatives of the residuals along K directions, as Renderer.jvp() has those of images
    residuals  [...], such as image - target
    weights    of the residuals' squares, of a shape that broadcasts to theirs; 1 without

    Arrays of NumPy, PyTorch or JAX; sums are in their type. Costs 2 K^2 operations a residual. Raises ValueError for
    tangents of another shape than the residuals'.
    """
    tangents, residuals = _arrays.from_numbers(tangents), _arrays.from_numbers(residuals)
    for name, array in (("tangents", tangents), ("residuals", residuals)):
        _arrays.require_array(name, array, "dpr.normal_equations")
    if len(tangents.shape) == 0 or tuple(tangents.shape[1:]) != tuple(residuals.shape):
        _arrays.fail(ValueError, "tangents", list(tangents.shape), f"[K, {', '.join(map(str, residuals.shape))}]",
                     "dpr.normal_equations")
    rows = tangents.reshape(tangents.shape[0], -1)
    weighted = rows if weights is None else (tangents * weights).reshape(rows.shape)
    return weighted @ rows.T, weighted @ residuals.reshape(-1)
