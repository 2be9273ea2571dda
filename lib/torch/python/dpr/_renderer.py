"""Renderer, and render() in one call."""
import warnings

import torch

from . import _arguments
from ._subdivision import Subdivision

_LIGHT_KINDS = torch.ops.dpr._light_kinds()
_DIFFERENTIABLE = ("sigma", "gamma", "alpha")


def _is_compiling():
    compiler = getattr(torch, "compiler", None)
    return bool(compiler and getattr(compiler, "is_compiling", lambda: False)())


class Renderer:
    """What stays the same from call to call: size of the images, smoothing, clipping, culling, shading, device.

    width, height   of the images, pixels
    device          OpenCL device: "" for DPR_DEVICE or else the best there is, "cpu", "gpu", a number, or a part of
                    a name
    settings        any key of a scene's "smoothing" (lib/cli/README.md), with a number or a word: preset ("pixel"
                    unless given), sigma, gamma, samples, ...; and
        znear, zfar world units, between which triangles are rendered. Left out, every view has powers of two around the
                    depths of its vertices, the near one at least 1/1024 of the far one. Triangles that reach beyond
                    zfar are dropped whole; at znear they are clipped.
        cull        "none", "back" or "front"
        shading, shininess  of lights: "phong", "blinn", "gouraud" or "flat"; 64 unless given

    A Renderer is pickled with its settings. Devices are opened, and kernels built, by the first call in a process.
    OpenCL does not survive fork(): a process forked after that gets an error from a call; start it with "spawn", or
    render in the parent later. Frames of a graph hold buffers on the device until the graph is freed; some buffers
    are kept for later calls with the same faces and size (release()).
    """

    def __init__(self, width, height, *, device="", **settings):
        settings = {"preset": "pixel", **settings}
        self.width, self.height, self.device = width, height, device
        self.settings = {name: _arguments.number(name, value) for name, value in settings.items()
                         if value is not None}
        self._texts = [f"{name}={value}" for name, value in self.settings.items()]
        if not _is_compiling():
            torch.ops.dpr._check_settings(width, height, self._texts)

    def __repr__(self):
        return f"dpr.Renderer({self.width}, {self.height}, device={self.device!r}, " + \
            ", ".join(f"{name}={value!r}" for name, value in self.settings.items()) + ")"

    def __call__(self, vertices, faces, views, intrinsics, *, colors=None, face_colors=None, background=None,
                 lights=None, sigma=None, gamma=None, alpha=None, outputs=(), copy=False):
        """Renders N views of one mesh, of N shapes of one topology, or of N meshes.

        vertices     [V, 3] or [N, V, 3], world space
        faces        [F, 3], int64 or int32: indices of vertices
        views        [N, 4, 4], world to camera, acting on column vectors; the camera looks down -z, y is up (OpenGL)
        intrinsics   [N, 4], fx, fy, cx, cy in pixels from the corner of the top-left pixel (OpenCV's cx and cy plus
                     0.5); [N, 9], the same and OpenCV's k1, k2, p1, p2, k3; [N, 1], orthographic: world units from
                     the lower to the upper edge
        colors       [V, 3] or [N, V, 3], linear RGB of the vertices; or
        face_colors  [F, 3] or [N, F, 3], of the faces; white without either
        background   [3], linear RGB; black unless given
        lights       a dictionary, with what it names, the same for all views: "ambient" [3] (0.5 if left out),
                     "harmonics" [9, 3], "point" [L, 9] (position, diffuse, specular), "directional" [L, 9] (direction,
                     diffuse, specular), "spot" [L, 14] (position, direction, angle and inner angle in degrees, diffuse,
                     specular). Without a dictionary colours are as they are.
        sigma, gamma, alpha   instead of the settings': numbers, or tensors of one number
        outputs      names of "depth", "normal", "face_id", "barycentrics", "effective_faces". Depth and normal are those of
                     what may cover a pixel, at full size wherever alpha is above 0: weigh them by alpha
        copy         whether tensors on other devices are copied to the CPU, and the images back

        Meshes of different topology are lists, one mesh a view: of [V_i, 3], of [F_i, 3], and of their colours; or
        padded, faces [N, F, 3] with -1 behind a mesh's last face and vertices [N, V, 3]. They are rendered one after
        the other, each with a node of its own in the graph.

        Returns the images [N, height, width, 4]: linear RGB over the background, which is not to be blended by alpha
        again, and alpha, the silhouette. With outputs, (images, {name: tensor}): depth [N, height, width] along the
        view direction, world units; normal [N, height, width, 3], world space; face_id, int64, -1 on the background;
        barycentrics [N, height, width, 3]; effective_faces, how many faces share a pixel.

        The images have first derivatives with respect to every float tensor above: those of the views are of any affine
        matrices, with lights of rigid motions. The outputs have none. Errors name the argument: TypeError and
        ValueError of tensors, RuntimeError of what they hold. A UserWarning tells that every triangle was dropped,
        but not from within torch.compile.
        """
        smoothing = {"sigma": sigma, "gamma": gamma, "alpha": alpha}
        background = torch.zeros(3) if background is None else background
        if colors is not None and face_colors is not None:
            _arguments.fail(ValueError, "colors", "colors and face_colors", "one of them")
        if isinstance(faces, torch.Tensor) and faces.dim() == 3:
            vertices, faces, colors, face_colors = _arguments.lists_of_padded(vertices, faces, colors, face_colors)
        shared = (background, lights, smoothing, outputs, copy)
        if isinstance(faces, (list, tuple)):
            return self._render_each(vertices, faces, views, intrinsics, colors, face_colors, shared)
        return self._render(vertices, faces, views, intrinsics, colors, face_colors, shared, first_view=0)

    def subdivide(self, vertices, faces, views, intrinsics, *, tolerance=0.25, copy=False):
        """Cuts a mesh's faces where lenses bend their edges, which images draw straight between vertices.

        vertices [V, 3], and faces, views and intrinsics as a call takes them. Edges are halved until no view shows a
        point of one further than `tolerance` pixels from where it is drawn, for all faces at them, also between
        vertices that only coincide. Without lenses nothing is cut. The result is right for meshes and cameras near
        these: cut again when they have moved. With lights, normals are those of the pieces: new vertices have their
        face's own, so that what coarse faces shade smoothly gets flat within them.

        Returns a Subdivision: its faces and of_vertices(vertices) are to be rendered. The cut itself has no derivative.
        """
        arguments = [("vertices", vertices, [("V", 3)]), ("views", views, [("N", 4, 4)]),
                     ("intrinsics", intrinsics, [("N", n) for n in (4, 9, 1)])]
        vertices, views, intrinsics = (_arguments.floats(*a, copy).detach() for a in arguments)
        tolerance = float(_arguments.number("tolerance", tolerance))
        faces = _arguments.indices(faces, copy)
        return Subdivision(*torch.ops.dpr._subdivide(self.width, self.height, self._texts, tolerance, faces,
                                                     vertices[None], views, intrinsics))

    def _render_each(self, vertices, faces, views, intrinsics, colors, face_colors, shared):
        """Meshes that differ, one a view. Sampled noise is that of the views' places in the batch."""
        views = _arguments.floats("views", views, [("N", 4, 4)], shared[-1])
        count = views.shape[0]
        if count == 0:
            _arguments.fail(ValueError, "views", [0, 4, 4], "at least one view")
        intrinsics = _arguments.floats("intrinsics", intrinsics, [(count, n) for n in (4, 9, 1)], shared[-1])
        nothing = [None] * count
        lists = {"vertices": vertices, "faces": faces, "colors": nothing if colors is None else colors,
                 "face_colors": nothing if face_colors is None else face_colors}
        for name, meshes in lists.items():
            if not isinstance(meshes, (list, tuple)) or len(meshes) != count:
                got = f"{len(meshes)} meshes" if isinstance(meshes, (list, tuple)) else type(meshes).__name__
                _arguments.fail(ValueError, name, got, f"a list of {count}, one a view, as faces are a list")
        rendered = [self._render(v, f, views[i:i + 1], intrinsics[i:i + 1], c, fc, shared, first_view=i)
                    for i, (v, f, c, fc) in enumerate(zip(*lists.values()))]
        if isinstance(rendered[0], torch.Tensor):
            return torch.cat(rendered)
        images, outputs = zip(*rendered)
        return torch.cat(images), {name: torch.cat([o[name] for o in outputs]) for name in outputs[0]}

    def _render(self, vertices, faces, views, intrinsics, colors, face_colors, shared, first_view):
        background, lights, smoothing, outputs, copy = shared
        home = vertices.device if isinstance(vertices, torch.Tensor) else torch.device("cpu")
        faces = _arguments.indices(faces, copy)
        vertices = _batched(_arguments.floats("vertices", vertices, [("V", 3), ("N", "V", 3)], copy))
        views = _arguments.floats("views", views, [("N", 4, 4)], copy)
        intrinsics = _arguments.floats("intrinsics", intrinsics, [("N", n) for n in (4, 9, 1)], copy)
        background = _arguments.floats("background", background, [(3,)], copy)
        colors = self._colors(vertices, faces, colors, face_colors, copy)
        light_numbers, light_counts = _arguments.lights(lights, _LIGHT_KINDS, copy)
        texts, names, numbers = self._smoothing(smoothing, copy)

        inputs = [vertices, colors, views, intrinsics, background, light_numbers, numbers]
        images, frame = torch.ops.dpr._render(self.device, self.width, self.height, texts, faces, inputs, light_counts,
                                              names, first_view, face_colors is not None, False)
        if not _is_compiling() and torch.ops.dpr._is_empty(frame):
            warnings.warn("dpr: every triangle was dropped: outside the image, nearer than znear, beyond zfar, culled, "
                          "or without area", stacklevel=3)
        if copy:
            images = images.to(home)
        if not outputs:
            return images
        found = torch.ops.dpr._auxiliary(frame, list(outputs), views.shape[0], self.height, self.width)
        return images, {name: tensor.to(home) for name, tensor in zip(outputs, found)}

    def _colors(self, vertices, faces, colors, face_colors, copy):
        """[1 or N, V, 3], or of faces [1 or N, F, 3]."""
        count, vertex_count = faces.shape[0], vertices.shape[1]
        if face_colors is None:
            if colors is None:
                return torch.ones(1, vertex_count, 3)
            return _batched(_arguments.floats("colors", colors, [(vertex_count, 3), ("N", vertex_count, 3)], copy))
        return _batched(_arguments.floats("face_colors", face_colors, [(count, 3), ("N", count, 3)], copy))

    def _smoothing(self, given, copy):
        """(settings, names of the tensors, their numbers)."""
        texts, names, numbers = list(self._texts), [], [torch.empty(0)]
        for name, value in given.items():
            if isinstance(value, torch.Tensor):
                names.append(name)
                numbers.append(_arguments.floats(name, value, [(), (1,)], copy).reshape(1))
            elif value is not None:
                texts.append(f"{name}={value}")
        return texts, names, torch.cat(numbers)


def _batched(tensor):
    return tensor if tensor.dim() == 3 else tensor[None]


def render(vertices, faces, views, intrinsics, *, width, height, colors=None, face_colors=None, background=None,
           lights=None, sigma=None, gamma=None, alpha=None, outputs=(), copy=False, device="", **settings):
    """Renderer(width, height, device=device, **settings) and its call in one: see there."""
    renderer = Renderer(width, height, device=device, **settings)
    return renderer(vertices, faces, views, intrinsics, colors=colors, face_colors=face_colors, background=background,
                    lights=lights, sigma=sigma, gamma=gamma, alpha=alpha, outputs=outputs, copy=copy)


def subdivide(vertices, faces, views, intrinsics, *, width, height, tolerance=0.25, copy=False, **settings):
    """Renderer(width, height, **settings).subdivide(): see there."""
    return Renderer(width, height, **settings).subdivide(vertices, faces, views, intrinsics, tolerance=tolerance,
                                                         copy=copy)


def release():
    """Frees what is kept on devices for later calls; what graphs hold stays."""
    torch.ops.dpr._release()
