"""Arrays of whatever library, which is imported only by those who hand its arrays in."""
import sys

import numpy as np


def fail(error, name, got, expected):
    raise error(f"dpr: error: {name} (dpr.render): got {got}, expected {expected}")


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


def type_of(array):
    """"float32\""""
    return str(array.dtype).rpartition(".")[2]


def require(name, array, types, expected):
    """Fails unless it is an array of one of the types."""
    if not is_array(array):
        fail(TypeError, name, type(array).__name__, "a tensor or an array")
    if type_of(array) not in types:
        fail(TypeError, name, type_of(array), expected)


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
