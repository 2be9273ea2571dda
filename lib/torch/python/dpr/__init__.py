"""dpr: differentiable rendering of triangle meshes by OpenCL, for PyTorch.

    image = dpr.render(vertices, faces, views, intrinsics, width=256, height=256)

render() does all of it in one call; a Renderer keeps what stays the same from call to call. Both take float32 tensors
on the CPU and differentiate with respect to vertices, colours, textures, materials, cameras, background, lights, sigma,
gamma and alpha.
"""
from ._library import BUILT_FOR, load

load()

from ._renderer import Renderer, render, release, subdivide  # noqa: E402  which need the operators
from ._subdivision import Subdivision  # noqa: E402

