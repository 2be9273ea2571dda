"""Derivatives of arrays that have none of their own."""
import numpy as np

from . import _arrays, _frames


def nested(plan, found):
    """Gradients {leaf: gradient} as those of what was given, at their arguments' paths: names are of dictionaries, numbers of
    lists, None where there is none."""
    root = {}
    for leaf, gradient in found.items():
        *path, last = plan.paths[leaf]
        place = root
        for key in path:
            place = place.setdefault(key, {})
        place[last] = _arrays.restored(plan.given[leaf], gradient)

    def listed(place):
        if not isinstance(place, dict):
            return place
        place = {key: listed(value) for key, value in place.items()}
        if all(isinstance(key, int) for key in place):
            return [place.get(i) for i in range(max(place) + 1)]
        return place

    return {name: listed(place) for name, place in root.items()}


def _require_given(argument, names, plan):
    given = {path[0] for path, leaf in zip(plan.paths, plan.leaves) if _arrays.type_of(leaf) == "float32"}
    for name in names:
        if name not in given:
            _arrays.fail(ValueError, argument, repr(name), "names of given arrays that are no indices: " +
                         ", ".join(sorted(given)) + "; a number is one as np.array(number)")


def _at(path, place):
    """What nested lists and dictionaries have there; None for nothing."""
    for key in path:
        if isinstance(place, dict):
            place = place.get(key)
        elif isinstance(place, (list, tuple)):
            place = place[key] if key < len(place) else None
    return place


def tangents_of_leaves(plan, tangents):
    """{number of a leaf: [K, ...]}"""
    if not isinstance(tangents, dict):
        _arrays.fail(TypeError, "tangents", type(tangents).__name__, "a dictionary by names of arrays")
    _require_given("tangents", tangents, plan)
    for name, inner in tangents.items():
        for key in inner if isinstance(inner, dict) else ():
            if not any(path[0] == name and path[-1] == key for path in plan.paths):
                _arrays.fail(ValueError, f"tangents of {name}", repr(key), "names of arrays that are given")
    found, count = {}, None
    for number, (path, given, leaf) in enumerate(zip(plan.paths, plan.given, plan.leaves)):
        tangent = _arrays.from_numbers(_at(path, tangents))
        if tangent is None:
            continue
        name = "tangents of " + ".".join(map(str, path))
        tangent = _arrays.to_numpy(_arrays.converted(name, tangent))
        if count is None and tangent.ndim == 1 + len(given.shape):
            count = len(tangent)
        if tangent.shape != (count, *given.shape) or not count:
            _arrays.fail(ValueError, name, list(tangent.shape), f"[{', '.join(map(str, (count or 'K', *given.shape)))}]")
        if leaf.shape != given.shape:
            tangent = np.repeat(tangent.reshape(count, -1, *leaf.shape[1:]), leaf.shape[0], 1)
        found[number] = tangent * plan.slopes[number]() if number in plan.slopes else tangent
    if not found:
        _arrays.fail(ValueError, "tangents", "none", "those of one array at least")
    return found


def jvp(spec, plan, tangents):
    """(outputs, tangents of the images, warning)"""
    moved = tangents_of_leaves(plan, tangents)
    rendered = _frames.Rendered(spec, [_arrays.to_numpy(leaf) for leaf in plan.leaves], tuple(moved))
    home = plan.given[0]
    return ([_arrays.like(home, output) for output in rendered.outputs], _arrays.like(home, rendered.tangents(moved)),
            rendered.warning)


def vjp(spec, plan, wrt):
    """(outputs, pullback, warning)"""
    leaves, paths = plan.leaves, plan.paths
    if isinstance(wrt, str):
        _arrays.fail(TypeError, "wrt", repr(wrt), "a list of names")
    _require_given("wrt", wrt or (), plan)
    wanted = tuple(i for i, (leaf, path) in enumerate(zip(leaves, paths))
                   if _arrays.type_of(leaf) == "float32" and (wrt is None or path[0] in wrt))
    rendered = _frames.Rendered(spec, [_arrays.to_numpy(leaf) for leaf in leaves], wanted)

    def pullback(image=None, **outputs):
        for name in outputs:
            if name not in spec.outputs or name not in _frames.WITH_GRADIENTS:
                _arrays.fail(ValueError, "gradient", repr(name), "image, or outputs of this call that have gradients")
        grads = []
        for name, (shape, _) in zip(["image", *spec.outputs], _frames.shapes_of(spec, rendered.outputs[0].shape[0])):
            grad = _arrays.from_numbers(image if name == "image" else outputs.get(name))
            if grad is not None:
                _arrays.require_array(f"gradient of {name}", grad, expected="an array; those of outputs by their names")
                if tuple(grad.shape) != shape:
                    _arrays.fail(ValueError, f"gradient of {name}", list(grad.shape), list(shape))
                grad = _arrays.to_numpy(grad)
            grads.append(grad)
        found = rendered.gradients(grads)
        for leaf, slope in plan.slopes.items():
            if leaf in found:
                found[leaf] = np.asarray(found[leaf] * slope(), np.float32)
        return nested(plan, found)

    return [_arrays.like(plan.given[0], output) for output in rendered.outputs], pullback, rendered.warning
