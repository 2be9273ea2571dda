"""dpr: differentiable rendering of triangle meshes by OpenCL, for NumPy, PyTorch and JAX.

    image = dpr.render(vertices, faces, views, intrinsics, width=256, height=256)

render() does all of it in one call; a Renderer keeps what stays the same from call to call. Both take arrays, tensors and
lists, read those of float32 where they are and convert the rest, and differentiate with respect to vertices, colours,
textures, materials, cameras, background, lights, sigma or blur, gamma and alpha: by the graph of PyTorch and JAX, and
by render_with_vjp() and render_with_jvp() for all others. rasterize() puts the edges' noise around shading of one's own,
for which texture() reads textures. look_at(), perspective() and cameras make views and intrinsics; read_mesh() makes
arguments of a file, write_mesh() a file of arguments, and read_image() and write_image() go with them; image_loss() is one
of images, MeshLoss, chamfer() and sample_points() are of shapes. Two modules are for PyTorch alone: dpr.shading has
materials, environments and shadows, dpr.nvdiffrast nvdiffrast's operations.
"""
import importlib as _importlib

from . import cameras
from ._files import read_image, read_mesh, write_image, write_mesh
from ._image_losses import image_loss
from ._least_squares import normal_equations
from ._library import DeviceError, Error, InvalidArgument, IoError, devices, release
from ._losses import MeshLoss, chamfer, sample_points
from ._renderer import Renderer, rasterize, render, render_with_jvp, render_with_vjp, subdivide
from ._samples import Samples
from ._subdivision import Subdivision
from ._texture_maps import texture, texture_with_vjp
from ._version import VERSION as __version__
from .cameras import look_at, perspective

__all__ = ["DeviceError", "Error", "InvalidArgument", "IoError", "MeshLoss", "Renderer", "Samples", "Subdivision",
           "cameras", "chamfer", "devices", "image_loss", "look_at", "normal_equations", "perspective", "rasterize",
           "read_image", "read_mesh", "release", "render", "render_with_jvp", "render_with_vjp", "sample_points",
           "subdivide", "texture", "texture_with_vjp", "write_image", "write_mesh"]


def __getattr__(name):
    """The modules that import PyTorch, when they are first asked for."""
    if name in ("nvdiffrast", "shading"):
        return _importlib.import_module("." + name, __name__)
    raise AttributeError(f"module 'dpr' has no attribute '{name}'")
