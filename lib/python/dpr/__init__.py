"""dpr: differentiable rendering of triangle meshes by OpenCL, for NumPy, PyTorch and JAX.

    image = dpr.render(vertices, faces, views, intrinsics, width=256, height=256)

render() does all of it in one call; a Renderer keeps what stays the same from call to call. Both take arrays, tensors and
lists, read those of float32 where they are and convert the rest, and differentiate with respect to vertices, colours,
textures, materials, cameras, background, lights, sigma or blur, gamma and alpha: by the graph of PyTorch and JAX, and
by render_with_vjp() and render_with_jvp() for all others. rasterize() puts the edges' noise around shading of one's own.
look_at(), perspective() and cameras make views and intrinsics. The module dpr.nvdiffrast, imported by itself, has
nvdiffrast's operations for PyTorch.
"""
from . import cameras
from ._least_squares import normal_equations
from ._library import DeviceError, Error, InvalidArgument, devices, release
from ._renderer import Renderer, rasterize, render, render_with_jvp, render_with_vjp, subdivide
from ._samples import Samples
from ._subdivision import Subdivision
from ._version import VERSION as __version__
from .cameras import look_at, perspective

__all__ = ["DeviceError", "Error", "InvalidArgument", "Renderer", "Samples", "Subdivision", "cameras", "devices", "look_at",
           "normal_equations", "perspective", "rasterize", "release", "render", "render_with_jvp", "render_with_vjp",
           "subdivide"]
