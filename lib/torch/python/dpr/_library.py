"""Loads the operators, if they were built for the PyTorch that is here."""
import pathlib
import re

import torch

from . import _build

BUILT_FOR = _build.TORCH_VERSION
"""The release of PyTorch that the operators were built for, as "2.4.1"."""


def check(version, has_cxx11_strings):
    """Raises ImportError for another PyTorch: its C++ interface differs, and calls between the two may crash."""
    found = re.match(r"\d+(\.\d+)*", version).group()
    if found == BUILT_FOR and has_cxx11_strings == _build.CXX11_STRINGS:
        return
    strings = {True: "", False: " with the strings of before C++11"}
    raise ImportError(
        f"dpr: error: PyTorch (import dpr): got {found}{strings[has_cxx11_strings]}, expected "
        f"{BUILT_FOR}{strings[_build.CXX11_STRINGS]}, which this dpr was built for; install dpr again beside this one")


def load():
    check(torch.__version__, torch._C._GLIBCXX_USE_CXX11_ABI)
    torch.ops.load_library(str(pathlib.Path(__file__).parent / _build.LIBRARY))
    _register_shapes()


def _register_shapes():
    """Tells compilers of graphs the shapes of what the operators return, where torch can be told."""
    register = getattr(torch.library, "register_fake", None)
    if register is None:
        return

    def render(device, width, height, settings, indices, inputs, light_counts, texture_sizes, wraps, filters,
               smoothing_names, first_view, face_colors, separate_shapes):
        vertices, views = inputs[0], inputs[2]
        return vertices.new_empty((views.shape[0], height, width, 4)), vertices.new_empty((1,), dtype=torch.uint8)

    def gradients(frame, grad_image, inputs, smoothing_names, wanted):
        return [x.new_empty(x.shape if is_wanted else (0,)) for x, is_wanted in zip(inputs, wanted)]

    def auxiliary(frame, names, views, height, width):
        channels = {"barycentrics": (3,), "uv": (2,)}
        types = {"face_id": torch.int64}
        return [frame.new_empty((views, height, width, *channels.get(name, ())), dtype=types.get(name, torch.float32))
                for name in names]

    def attributes(frame, names, inputs, smoothing_names, wanted, views, height, width):
        return [frame.new_empty((views, height, width, 4), dtype=torch.float32) for _ in names]

    def attribute_gradients(frame, names, grad_images, images, inputs, smoothing_names, wanted):
        return [x.new_empty(x.shape if is_wanted else (0,)) for x, is_wanted in zip(inputs, wanted)]

    register("dpr::_render")(render)
    register("dpr::_gradients")(gradients)
    register("dpr::_auxiliary")(auxiliary)
    register("dpr::_attributes")(attributes)
    register("dpr::_attribute_gradients")(attribute_gradients)
