"""dpr: differentiable rendering of triangle meshes by OpenCL, for NumPy, PyTorch and JAX.

    image = dpr.render(vertices, faces, views, intrinsics, width=256, height=256)

render() does all of it in one call; a Renderer keeps what stays the same from call to call. Both take float32 arrays and
tensors, in whose memory they read, and differentiate with respect to vertices, colours, textures, materials, cameras,
background, lights, sigma, gamma and alpha: by the graph of PyTorch and JAX, and by render_with_vjp() for all others.
"""
from ._library import DeviceError, Error, InvalidArgument, devices, release
from ._renderer import Renderer, render, render_with_vjp, subdivide
from ._subdivision import Subdivision
from ._version import VERSION as __version__

__all__ = ["DeviceError", "Error", "InvalidArgument", "Renderer", "Subdivision", "devices", "release", "render",
           "render_with_vjp", "subdivide"]
