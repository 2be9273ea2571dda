"""Arrays of whatever library, which is imported only by those who hand its arrays in."""
import functools
import numbers
import sys

import numpy as np


def fail(error, name, got, expected, where="dpr.render"):
    raise error(f"dpr: error: {name} ({where}): got {got}, expected {expected}")


def named(call):
    """Decorator: errors name the call, dpr.rasterize say, where its arguments are checked as those of dpr.render."""
    def decorated(function):
        @functools.wraps(function)
        def renamed(*arguments, **keywords):
            try:
                return function(*arguments, **keywords)
            except (TypeError, ValueError, RuntimeError) as error:
                if "(dpr.render)" in str(error):
                    error.args = (str(error).replace("(dpr.render)", f"({call})"),)
                raise
        return renamed
    return decorated


def module_of(array):
    """"torch", "jax", "numpy", or "dlpack" for what else gives its memory; None for no array."""
    for name, kind in (("torch", "Tensor"), ("jax", "Array")):
        library = sys.modules.get(name)
        if library is not None and isinstance(array, getattr(library, kind, ())):
            return name
    if isinstance(array, np.ndarray):
        return "numpy"
    return "dlpack" if hasattr(array, "__dlpack__") else None


def is_array(value):
    return module_of(value) is not None


def is_compiling():
    """True within torch.compile, which traces what is done with tensors."""
    if "torch" not in sys.modules:
        return False
    from . import _torch
    return _torch.is_compiling()


_NAMES = {np.dtype(name): name for name in ("float32", "int32", "int64")}  # which NumPy takes microseconds to write


def type_of(array):
    """"float32\""""
    name = _NAMES.get(array.dtype) if isinstance(array, np.ndarray) else None
    return name or str(array.dtype).rpartition(".")[2]


def from_numbers(value, is_indices=False):
    """Nested lists of numbers as an array; what else is given as it is, ragged lists too."""
    if not _is_numbers(value):
        return value
    if is_compiling():
        torch = sys.modules["torch"]
        return torch.tensor(value, dtype=None if is_indices else torch.float32)
    try:
        array = np.array(value, np.float32)
    except ValueError:  # ragged
        return value
    return np.array(value) if is_indices else array


def _is_numbers(value):
    return isinstance(value, (list, tuple)) and len(value) > 0 and all(
        isinstance(item, numbers.Real) or _is_numbers(item) for item in value)


def as_type(array, name):
    """The same in another type; a differentiable function of tensors."""
    kind = module_of(array)
    if kind == "torch":
        return array.to(getattr(sys.modules["torch"], name))
    return array.astype(name) if kind == "jax" else to_numpy(array).astype(name, copy=False)


def require_array(name, array, where="dpr.render", expected="a tensor or an array"):
    """Fails for what is none."""
    if not is_array(array):
        fail(TypeError, name, type(array).__name__, expected, where)


def converted(name, array, is_indices=False, where="dpr.render"):
    """The array as float32, or as int32 or int64. Fails for no array and for another kind of numbers."""
    require_array(name, array, where)
    if module_of(array) == "torch" and array.layout is not sys.modules["torch"].strided:
        fail(TypeError, name, f"a tensor with layout {array.layout}", "one with torch.strided", where)
    kind = type_of(array)
    if kind != "float32" and isinstance(array, np.ndarray):
        kind = array.dtype.name  # ">f4" is "float32"
    if is_indices:
        if not kind.startswith(("int", "uint")):
            fail(TypeError, name, kind, "int64 or int32, indices", where)
        wanted = kind if kind in ("int64", "int32") else "int32" if module_of(array) == "jax" else "int64"
    else:
        if not kind.startswith(("float", "bfloat")):
            fail(TypeError, name, kind, "float32, or another type of floating-point numbers", where)
        wanted = "float32"
    return array if type_of(array) == wanted else as_type(array, wanted)


def batched(array):
    """[...] as [1, ...]; a differentiable function of tensors."""
    return (array if module_of(array) in ("torch", "jax") else to_numpy(array))[None]


def repeated(array, count):
    """[1, ...] as [count, ...]; a differentiable function of tensors."""
    shape, kind = (count, *array.shape[1:]), module_of(array)
    if kind == "torch":
        return array.expand(shape)
    if kind == "jax":
        return sys.modules["jax"].numpy.broadcast_to(array, shape)
    return np.repeat(to_numpy(array), count, 0)


def rows(array, places):
    """array[places], of one axis; a differentiable function of tensors."""
    kind = module_of(array)
    if kind == "torch":
        return array.index_select(0, like(array, places))
    return array[places] if kind == "jax" else like(array, np.take(to_numpy(array), places, 0))


def spread(array, places, count):
    """The transpose of rows(): floats [count, ...], 0 elsewhere."""
    shape, kind = (count, *array.shape[1:]), module_of(array)
    if kind == "torch":
        return array.new_zeros(shape).index_copy(0, like(array, places), array)
    if kind == "jax":
        return sys.modules["jax"].numpy.zeros(shape, np.float32).at[places].set(array)
    found = np.zeros(shape, np.float32)
    found[places] = to_numpy(array)
    return like(array, found)


def padded(arrays):
    """[V_i, ...] of one library as [N, most, ...], with zeros behind; a differentiable function of tensors."""
    kind = module_of(arrays[0])
    if kind == "torch":
        return sys.modules["torch"].nn.utils.rnn.pad_sequence(arrays, batch_first=True)
    module, most = sys.modules["jax"].numpy if kind == "jax" else np, max(map(len, arrays))
    rows = arrays if kind == "jax" else map(to_numpy, arrays)
    return like(arrays[0], module.stack([module.pad(row, ((0, most - len(row)), (0, 0))) for row in rows]))


def require_on_cpu(name, array, copy):
    """Fails for memory that OpenCL does not reach, unless it is to be copied."""
    if copy or module_of(array) in ("numpy", "jax"):  # JAX hands copies to what it calls
        return
    device = array.device if module_of(array) == "torch" else None
    if device is not None and device.type == "cpu" or device is None and array.__dlpack_device__()[0] == 1:
        return
    fail(ValueError, name, f"a tensor on {array.device}",
         "one on the CPU, as OpenCL does not reach the memory of other devices; copy=True copies tensors and images")


def to_numpy(array):
    """Its values; its memory where it is on the CPU."""
    if isinstance(array, np.ndarray):
        return array
    if module_of(array) == "jax":
        return np.asarray(array)
    if module_of(array) == "torch":
        array = array.detach().cpu()
        return np.from_dlpack(array.contiguous()) if array.numel() else np.empty(array.shape, type_of(array))
    if array.__dlpack_device__()[0] == 1:
        return np.from_dlpack(array)
    return np.from_dlpack(array, device="cpu", copy=True)


def known(array):
    """NumPy array of its values; None while a compiler only traces what is done with them, and within torch.func."""
    kind = module_of(array)
    if kind == "jax" and isinstance(array, sys.modules["jax"].core.Tracer) or is_compiling():
        return None
    if kind == "torch":
        is_wrapped = getattr(getattr(sys.modules["torch"]._C, "_functorch", None), "is_functorch_wrapped_tensor", None)
        if is_wrapped is not None and is_wrapped(array):
            return None
    return to_numpy(array)


def copied(array):
    """The same numbers in memory of their own; JAX's never change."""
    kind = module_of(array)
    if kind == "torch":
        return array.clone()
    return array if kind == "jax" else like(array, to_numpy(array).copy())


def restored(array, gradient):
    """The gradient of an array from that of what it was converted to, and repeated in the first dimension, which it may
    be without."""
    if gradient.shape != tuple(array.shape):
        gradient = gradient.sum(0, keepdims=gradient.ndim == len(array.shape))
    return as_type(like(array, gradient), type_of(array))


def like(array, result):
    """A NumPy array as one of the library of another: the same memory, if that is on the CPU."""
    kind = module_of(array)
    if kind == "torch":
        return sys.modules["torch"].from_dlpack(result).to(array.device)
    if kind == "jax":
        return sys.modules["jax"].numpy.asarray(result)
    if kind == "dlpack" and hasattr(array, "__array_namespace__"):
        return array.__array_namespace__().from_dlpack(result)
    return result
