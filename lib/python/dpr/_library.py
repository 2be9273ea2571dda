"""libdpr: found, loaded, and called by ctypes, which lets other threads of Python run meanwhile."""
import atexit
import ctypes
import glob
import os
import pathlib
import sys
import warnings
from typing import Any, Dict, List

from ._version import VERSION

_HOW_TO_GET_A_DRIVER = ("install one: `apt install ocl-icd-libopencl1 pocl-opencl-icd` on Debian and Ubuntu, `pip install` the wheel "
                        "dpr_pocl, or that of a GPU's vendor")


def warn(text: str) -> None:
    """A UserWarning at the line that called the package."""
    level, frame = 2, sys._getframe(1)
    while frame.f_back and frame.f_globals.get("__package__") == __package__:
        level, frame = level + 1, frame.f_back
    warnings.warn(text, stacklevel=level)


class Error(RuntimeError):
    """Error of the library."""


class InvalidArgument(Error, ValueError):
    """An argument has a value that cannot be used."""


class IoError(Error, OSError):
    """A file cannot be read or written."""


class DeviceError(Error):
    """An OpenCL call failed, or a kernel did not compile."""


_ERRORS = {1: InvalidArgument, 2: IoError, 3: DeviceError, 4: DeviceError, 5: MemoryError}
"""By the values of dpr_status."""


class Array(ctypes.Structure):
    """dpr_array"""
    _fields_ = [("name", ctypes.c_char_p), ("data", ctypes.c_void_p), ("element", ctypes.c_int),
                ("dimensions", ctypes.c_int), ("shape", ctypes.c_size_t * 4)]


class Options(ctypes.Structure):
    """dpr_frame_options"""
    _fields_ = [("size", ctypes.c_size_t), ("device", ctypes.c_char_p), ("width", ctypes.c_int),
                ("height", ctypes.c_int), ("settings", ctypes.POINTER(ctypes.c_char_p)),
                ("setting_count", ctypes.c_size_t), ("is_lit", ctypes.c_int), ("first_view", ctypes.c_size_t),
                ("gradients", ctypes.POINTER(ctypes.c_char_p)), ("gradient_count", ctypes.c_size_t),
                ("defers_image", ctypes.c_int)]


class Raster(ctypes.Structure):
    """dpr_raster"""
    _fields_ = [(name, ctypes.c_int) for name in ("width", "height", "supersampling", "margin", "layers")]


class MeshContents(ctypes.Structure):
    """dpr_mesh_contents"""
    _fields_ = [("size", ctypes.c_size_t), ("arrays", ctypes.POINTER(Array)), ("array_count", ctypes.c_size_t),
                ("settings", ctypes.POINTER(ctypes.c_char_p)), ("setting_count", ctypes.c_size_t),
                ("notes", ctypes.POINTER(ctypes.c_char_p)), ("note_count", ctypes.c_size_t)]


class DeviceInfo(ctypes.Structure):
    """dpr_device_info"""
    _fields_ = [("size", ctypes.c_size_t),
                *((name, ctypes.c_char_p) for name in ("platform", "name", "vendor", "version", "driver", "type")),
                ("memory_bytes", ctypes.c_size_t), ("compute_units", ctypes.c_uint), ("lanes", ctypes.c_uint),
                ("is_default", ctypes.c_int)]


_HANDLE, _SIZE = ctypes.c_void_p, ctypes.c_size_t
_ARRAYS = [ctypes.POINTER(Array), _SIZE]
_SIGNATURES = {
    "dpr_device_count": [ctypes.POINTER(_SIZE)],
    "dpr_device_describe": [_SIZE, ctypes.POINTER(DeviceInfo)],
    "dpr_frame_check": [ctypes.POINTER(Options)],
    "dpr_frame_render": [ctypes.POINTER(Options), *_ARRAYS, ctypes.POINTER(_HANDLE)],
    "dpr_frame_read": [_HANDLE, *_ARRAYS],
    "dpr_frame_backward": [_HANDLE, *_ARRAYS, *_ARRAYS],
    "dpr_frame_tangent": [_HANDLE, _SIZE, *_ARRAYS, ctypes.c_void_p, _SIZE],
    "dpr_frame_raster": [_HANDLE, ctypes.POINTER(Raster)],
    "dpr_frame_samples": [_HANDLE, *_ARRAYS],
    "dpr_frame_samples_backward": [_HANDLE, *_ARRAYS, *_ARRAYS],
    "dpr_frame_covered": [_HANDLE, ctypes.POINTER(_SIZE)],
    "dpr_frame_interpolate": [_HANDLE, *_ARRAYS, ctypes.POINTER(Array)],
    "dpr_frame_interpolate_backward": [_HANDLE, *_ARRAYS, *[ctypes.POINTER(Array)] * 2, *_ARRAYS],
    "dpr_frame_resolve": [_HANDLE, ctypes.POINTER(Array), ctypes.POINTER(Array)],
    "dpr_frame_resolve_backward": [_HANDLE, *[ctypes.POINTER(Array)] * 3, *_ARRAYS],
    "dpr_frame_samples_tangent": [_HANDLE, ctypes.c_size_t, *_ARRAYS, *_ARRAYS],
    "dpr_frame_resolve_tangent": [_HANDLE, ctypes.c_size_t, *_ARRAYS, *[ctypes.POINTER(Array)] * 3],
    "dpr_frame_is_empty": [_HANDLE, ctypes.POINTER(ctypes.c_int)],
    "dpr_frames_release": [],
    "dpr_cut_create": [ctypes.POINTER(Options), *_ARRAYS, ctypes.c_float, ctypes.POINTER(_HANDLE)],
    "dpr_cut_size": [_HANDLE, ctypes.POINTER(_SIZE), ctypes.POINTER(_SIZE)],
    "dpr_cut_read": [_HANDLE, *_ARRAYS],
    "dpr_clip_space_create": [ctypes.c_int, ctypes.c_int, *_ARRAYS, ctypes.POINTER(_HANDLE)],
    "dpr_clip_space_size": [_HANDLE, ctypes.POINTER(_SIZE), ctypes.POINTER(_SIZE)],
    "dpr_clip_space_read": [_HANDLE, *_ARRAYS],
    "dpr_vertex_normals": [*_ARRAYS, ctypes.POINTER(Array)],
    "dpr_vertex_normals_backward": [*_ARRAYS, *[ctypes.POINTER(Array)] * 2],
    "dpr_texture_map": [*_ARRAYS, *[ctypes.c_char_p] * 2, ctypes.POINTER(Array)],
    "dpr_texture_map_backward": [*_ARRAYS, *[ctypes.c_char_p] * 2, ctypes.POINTER(Array), *_ARRAYS],
    "dpr_texture_map_tangent": [*_ARRAYS, *[ctypes.c_char_p] * 2, *_ARRAYS, ctypes.POINTER(Array)],
    "dpr_image_file_read": [ctypes.c_char_p, ctypes.c_char_p, ctypes.POINTER(_HANDLE)],
    "dpr_image_file_pixels": [_HANDLE, ctypes.POINTER(Array)],
    "dpr_image_file_write": [ctypes.c_char_p, ctypes.c_char_p, ctypes.POINTER(Array)],
    "dpr_mesh_file_read": [ctypes.c_char_p, ctypes.POINTER(_HANDLE)],
    "dpr_mesh_file_contents": [_HANDLE, ctypes.POINTER(MeshContents)],
    "dpr_mesh_file_write": [ctypes.c_char_p, *_ARRAYS, ctypes.POINTER(ctypes.c_char_p), _SIZE],
}


def _candidates():
    """Places of the library: as DPR_LIBRARY says, in the wheel, in the build tree, or the system's."""
    if os.environ.get("DPR_LIBRARY"):
        return [os.environ["DPR_LIBRARY"]]
    package = pathlib.Path(__file__).parent
    soname = "libdpr.so." + VERSION.rpartition(".")[0]
    found = [path for folder in (package, package.parent.parent / "lib") for path in sorted(glob.glob(f"{folder}/{soname}*"))]
    return found[:1] or [soname]


def _load():
    try:
        import dpr_pocl  # brings a driver of its own, and says so to what libdpr loads
    except ModuleNotFoundError:
        pass
    else:
        dpr_pocl.activate()
    (path,) = _candidates()
    try:
        library = ctypes.CDLL(path)
    except OSError as error:
        what, expected = "libdpr", "the package with its library, or its file in DPR_LIBRARY"
        if "OpenCL" in str(error):
            what, expected = "OpenCL", "the loader libOpenCL.so.1 and a driver; " + _HOW_TO_GET_A_DRIVER
        raise ImportError(f"dpr: error: {what} (import dpr): got {error}, expected {expected}") from None
    library.dpr_version.restype = library.dpr_last_error.restype = ctypes.c_char_p
    version = library.dpr_version().decode()
    if version != VERSION:
        raise ImportError(f"dpr: error: libdpr (import dpr): got version {version} in {path}, expected {VERSION}")
    library.dpr_frame_settings.restype = ctypes.c_char_p
    for name, arguments in _SIGNATURES.items():
        getattr(library, name).argtypes = arguments
    for name in ("dpr_frame_destroy", "dpr_cut_destroy", "dpr_clip_space_destroy", "dpr_image_file_destroy",
                 "dpr_mesh_file_destroy"):
        getattr(library, name).argtypes, getattr(library, name).restype = [_HANDLE], None
    return library


def _warn_without_driver():
    """By the files of the loaders alone: a driver that is asked for its devices starts threads, which no fork has."""
    variables = ("OCL_ICD_VENDORS", "OCL_ICD_FILENAMES", "OPENCL_VENDOR_PATH")
    folder = pathlib.Path("/etc/OpenCL/vendors")
    if any(os.environ.get(name) for name in variables) or any(folder.glob("*.icd")):
        return
    warnings.warn(f"dpr: no OpenCL driver in {folder}: nothing can be rendered; {_HOW_TO_GET_A_DRIVER}", stacklevel=4)


library = _load()
atexit.register(library.dpr_frames_release)  # a driver's thread that still compiles a kernel would crash as the process ends
_warn_without_driver()
setting_names = tuple(library.dpr_frame_settings().decode().split(", "))


def call(name, *arguments):
    """Calls a function that returns a dpr_status."""
    status = getattr(library, name)(*arguments)
    if status:
        text = library.dpr_last_error().decode(errors="replace").replace("(batch)", "(dpr.render)")
        text = text.replace("(attribute images)", "(outputs, dpr.render)").replace("(dpr_mesh_file_write)", "(dpr.write_mesh)")
        raise _ERRORS.get(status, Error)("dpr: error: " + text)


def devices() -> List[Dict[str, Any]]:
    """Every OpenCL device as a dictionary: index, platform, name, vendor, version, driver, type ("cpu", "gpu" or
    "accelerator"), memory_bytes, compute_units, lanes (width of the kernels' vectors), is_default. Empty without a
    driver. Drivers are loaded by this: processes forked from this one cannot render."""
    count = ctypes.c_size_t()
    call("dpr_device_count", ctypes.byref(count))
    found = []
    for index in range(count.value):
        info = DeviceInfo(size=ctypes.sizeof(DeviceInfo))
        call("dpr_device_describe", index, ctypes.byref(info))
        values = {name: getattr(info, name) for name, _ in DeviceInfo._fields_[1:]}
        values = {name: value.decode() if isinstance(value, bytes) else value for name, value in values.items()}
        found.append({"index": index, **values, "is_default": bool(info.is_default)})
    return found


def release() -> None:
    """Frees what is kept on devices for later calls; what graphs hold stays."""
    call("dpr_frames_release")
