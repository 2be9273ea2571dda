"""Gradients of arrays that have none of their own."""
import numpy as np

from . import _arrays, _frames


def _nested(paths, found):
    """The gradients at their arguments' paths: names are of dictionaries, numbers of lists, None where there is none."""
    root = {}
    for leaf, gradient in found.items():
        *path, last = paths[leaf]
        place = root
        for key in path:
            place = place.setdefault(key, {})
        place[last] = gradient

    def listed(place):
        if not isinstance(place, dict):
            return place
        place = {key: listed(value) for key, value in place.items()}
        if all(isinstance(key, int) for key in place):
            return [place.get(i) for i in range(max(place) + 1)]
        return place

    return {name: listed(place) for name, place in root.items()}


def vjp(spec, plan, wrt):
    """(outputs, pullback, warning)"""
    leaves, paths = plan.leaves, plan.paths
    names = {path[0] for path in paths}
    for name in wrt or ():
        if name not in names:
            _arrays.fail(ValueError, "wrt", repr(name), "names of arrays that are given: " + ", ".join(sorted(names)))
    wanted = tuple(i for i, (leaf, path) in enumerate(zip(leaves, paths))
                   if _arrays.type_of(leaf) == "float32" and (wrt is None or path[0] in wrt))
    rendered = _frames.Rendered(spec, [_arrays.to_numpy(leaf) for leaf in leaves], wanted)

    def pullback(image=None, **outputs):
        for name in outputs:
            if name not in spec.outputs or name not in _frames.WITH_GRADIENTS:
                _arrays.fail(ValueError, "gradient", repr(name), "image, or outputs of this call that have gradients")
        grads = [image, *(outputs.get(name) for name in spec.outputs)]
        for (shape, _), grad in zip(_frames.shapes_of(spec, rendered.outputs[0].shape[0]), grads):
            if grad is not None and tuple(grad.shape) != shape:
                _arrays.fail(ValueError, "gradient", list(grad.shape), list(shape))
        found = rendered.gradients([grad if grad is None else _arrays.to_numpy(grad) for grad in grads], wanted)
        for leaf, slope in plan.slopes.items():
            if leaf in found:
                found[leaf] = np.asarray(found[leaf] * slope(), np.float32)
        return _nested(paths, {leaf: _arrays.restored(plan.given[leaf], gradient) for leaf, gradient in found.items()})

    return [_arrays.like(plan.given[0], output) for output in rendered.outputs], pullback, rendered.warning
