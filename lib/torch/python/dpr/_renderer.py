"""Renderer, and render() in one call."""
import warnings

import torch

from . import _arguments, _outputs, _surface, _views
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

    def __call__(self, vertices, faces, views, intrinsics, *, colors=None, face_colors=None, texcoords=None,
                 face_texcoords=None, textures=None, face_textures=None, wrap="repeat", filter="bilinear",
                 materials=None, face_materials=None, background=None, lights=None, sigma=None, gamma=None, alpha=None,
                 outputs=(), copy=False):
        """Renders N views of one mesh, of N shapes of one topology, or of N meshes.

        vertices     [V, 3] or [N, V, 3], world space
        faces        [F, 3], int64 or int32: indices of vertices
        views        [N, 4, 4], world to camera, acting on column vectors; the camera looks down -z, y is up (OpenGL)
        intrinsics   [N, 4], fx, fy, cx, cy in pixels from the corner of the top-left pixel (OpenCV's cx and cy plus
                     0.5); [N, 9], the same and OpenCV's k1, k2, p1, p2, k3; [N, 1], orthographic: world units from
                     the lower to the upper edge
        colors       [V, 3] or [N, V, 3], linear RGB of the vertices; or
        face_colors  [F, 3] or [N, F, 3], of the faces; white without either
        texcoords    (u, v), v up, of the vertices [V, 2], of the faces' corners [F, 3, 2], or [T, 2] with
        face_texcoords  [F, 3], int64 or int32: their indices
        textures     [H, W, 3], linear RGB, row 0 on top, or a list of such of any sizes; [N, H, W, 3]: of each view by
                     itself. Colours multiply them
        face_textures   [F], int64 or int32: the faces' textures, -1 for none; all have the first unless given
        wrap         "repeat", "mirror" or "clamp", what lies beyond [0, 1]; a word, or a list of one a texture
        filter       "nearest", "bilinear" or "trilinear", which has a pyramid of smaller images; likewise
        materials    a dictionary of what highlights are multiplied by and their exponents: "specular" [M, 3] (1 if left
                     out), "shininess" [M] (the lights' if left out)
        face_materials  [F], int64 or int32: the faces' materials; all have the first unless given
        background   [3], linear RGB; black unless given
        lights       a dictionary, with what it names: "ambient" [3] (0.5 if left out), "harmonics" [9, 3], "point"
                     [L, 9] (position, diffuse, specular), "directional" [L, 9] (direction, diffuse, specular), "spot"
                     [L, 14] (position, direction, angle and inner angle in degrees, diffuse, specular); with a leading
                     N of each view by itself. Without a dictionary colours are as they are.
        sigma, gamma, alpha   instead of the settings': numbers, or tensors of one number
        outputs      names of "depth", "position", "normal", "texcoords", "face_id", "barycentrics", "uv",
                     "effective_faces". The first four are those of what may cover a pixel, at full size wherever alpha
                     is above 0: weigh them by alpha
        copy         whether tensors on other devices are copied to the CPU, and the images back

        Meshes of different topology are lists, one mesh a view: of [V_i, 3], of [F_i, 3], and likewise of their
        colours, textures (each a tensor or a list) and materials, with None for a mesh without; words and a dictionary
        may be those of all. Or they are padded, faces [N, F, 3] with -1 behind a mesh's last face and vertices
        [N, V, 3]. They are rendered one after the other, each with a node of its own in the graph; so are views that
        have textures or lights by themselves.

        Returns the images [N, height, width, 4]: linear RGB over the background, which is not to be blended by alpha
        again, and alpha, the silhouette. With outputs, (images, {name: tensor}): depth [N, height, width] along the
        view direction, world units; position and normal [N, height, width, 3], world space; texcoords
        [N, height, width, 2]; all of these the mean by the faces' weights (the normal at length 1), 0 where these sum
        to less than 1e-12. face_id [N, height, width], int64, of the face that weighs most, -1 on the background;
        barycentrics [N, height, width, 3] and uv [N, height, width, 2] of that face; effective_faces, how many faces
        share a pixel.

        The images have first derivatives with respect to every float tensor above: those of the views are of any affine
        matrices, with lights of rigid motions. Depth, position, normal and texcoords have those of vertices, views (of
        rigid motions), intrinsics, sigma, gamma, alpha and texture coordinates, by way of what is shown and of how
        much of it is seen, and cost about an image each, normals four. The other outputs have none. Errors name the
        argument: TypeError and ValueError of tensors, RuntimeError of what they hold. A UserWarning tells that every
        triangle was dropped, but not from within torch.compile.
        """
        smoothing = {"sigma": sigma, "gamma": gamma, "alpha": alpha}
        background = torch.zeros(3, dtype=torch.float32) if background is None else background
        if colors is not None and face_colors is not None:
            _arguments.fail(ValueError, "colors", "colors and face_colors", "one of them")
        mesh = {"vertices": vertices, "faces": faces, "colors": colors, "face_colors": face_colors,
                "texcoords": texcoords, "face_texcoords": face_texcoords, "textures": textures,
                "face_textures": face_textures, "wrap": wrap, "filter": filter, "materials": materials,
                "face_materials": face_materials}
        shared = (background, smoothing, outputs, copy)
        if isinstance(faces, torch.Tensor) and faces.dim() == 3:
            mesh = _views.lists_of_padded(mesh)
        if isinstance(mesh["faces"], (list, tuple)):
            return self._render_each(_views.lists_of_meshes, mesh, views, intrinsics, lights, shared)
        if _views.are_own(textures, lights):
            return self._render_each(_views.meshes_of_each, mesh, views, intrinsics, lights, shared)
        return self._render(mesh, views, intrinsics, lights, shared, first_view=0)

    def subdivide(self, vertices, faces, views, intrinsics, *, texcoords=None, face_texcoords=None, tolerance=0.25,
                  copy=False):
        """Cuts a mesh's faces where lenses bend their edges, which images draw straight between vertices.

        vertices [V, 3], and faces, views and intrinsics as a call takes them. Edges are halved until no view shows a
        point of one further than `tolerance` pixels from where it is drawn, for all faces at them, also between
        vertices that only coincide. Without lenses nothing is cut. The result is right for meshes and cameras near
        these: cut again when they have moved. With lights, normals are those of the pieces: new vertices have their
        face's own, so that what coarse faces shade smoothly gets flat within them.

        texcoords and face_texcoords, as a call takes them, come back as the pieces': `texcoords` [F', 3, 2] of the result,
        with gradients of the given ones.

        Returns a Subdivision: its faces and of_vertices(vertices) are to be rendered. The cut itself has no derivative.
        """
        arguments = [("vertices", vertices, [("V", 3)]), ("views", views, [("N", 4, 4)]),
                     ("intrinsics", intrinsics, [("N", n) for n in (4, 9, 1)])]
        vertices, views, intrinsics = (_arguments.floats(*a, copy).detach() for a in arguments)
        tolerance = float(_arguments.number("tolerance", tolerance))
        faces = _arguments.indices("faces", faces, ("F", 3), copy)
        pieces = torch.ops.dpr._subdivide(self.width, self.height, self._texts, tolerance, faces, vertices[None],
                                          views, intrinsics)
        cut = Subdivision(*pieces, of=(vertices.shape[0], faces.shape[0]))
        corners = _surface.corner_texcoords(texcoords, face_texcoords, faces, vertices.shape[0], copy)
        if corners is not None:
            cut.texcoords = cut.of_corners(corners, faces)
        return cut

    def _render_each(self, as_lists, mesh, views, intrinsics, lights, shared):
        """Views that differ, each by itself. Sampled noise is that of their places in the batch."""
        views = _arguments.floats("views", views, [("N", 4, 4)], shared[-1])
        count = views.shape[0]
        if count == 0:
            _arguments.fail(ValueError, "views", [0, 4, 4], "at least one view")
        intrinsics = _arguments.floats("intrinsics", intrinsics, [(count, n) for n in (4, 9, 1)], shared[-1])
        lists = as_lists(mesh, count)
        lights = _views.lights_of_each(lights, count)
        rendered = [self._render({name: values[i] for name, values in lists.items()}, views[i:i + 1],
                                 intrinsics[i:i + 1], lights[i], shared, first_view=i) for i in range(count)]
        if isinstance(rendered[0], torch.Tensor):
            return torch.cat(rendered)
        images, outputs = zip(*rendered)
        return torch.cat(images), {name: torch.cat([o[name] for o in outputs]) for name in outputs[0]}

    def _render(self, mesh, views, intrinsics, lights, shared, first_view):
        background, smoothing, outputs, copy = shared
        vertices = mesh["vertices"]
        home = vertices.device if isinstance(vertices, torch.Tensor) else torch.device("cpu")
        faces = _arguments.indices("faces", mesh["faces"], ("F", 3), copy)
        vertices = _batched(_arguments.floats("vertices", vertices, [("V", 3), ("N", "V", 3)], copy))
        views = _arguments.floats("views", views, [("N", 4, 4)], copy)
        intrinsics = _arguments.floats("intrinsics", intrinsics, [("N", n) for n in (4, 9, 1)], copy)
        background = _arguments.floats("background", background, [(3,)], copy)
        colors = self._colors(vertices, faces, mesh["colors"], mesh["face_colors"], copy)
        light_numbers, light_counts = _arguments.lights(lights, _LIGHT_KINDS, copy)
        texts, names, numbers = self._smoothing(smoothing, copy)
        of_surface, indices, modes = _surface.pack(mesh, faces, vertices.shape[1], copy)

        inputs = [vertices, colors, views, intrinsics, background, light_numbers, numbers, *of_surface]
        images, frame = torch.ops.dpr._render(self.device, self.width, self.height, texts, [faces, *indices], inputs,
                                              light_counts, *modes, names, first_view, mesh["face_colors"] is not None,
                                              False)
        if not _is_compiling() and torch.ops.dpr._is_empty(frame):
            warnings.warn("dpr: every triangle was dropped: outside the image, nearer than znear, beyond zfar, culled, "
                          "or without area", stacklevel=3)
        if copy:
            images = images.to(home)
        if not outputs:
            return images
        found = _outputs.of_frame(frame, list(outputs), [vertices, views, intrinsics, numbers, of_surface[0]], names,
                                  (views.shape[0], self.height, self.width))
        return images, {name: tensor.to(home) for name, tensor in found.items()}

    def _colors(self, vertices, faces, colors, face_colors, copy):
        """[1 or N, V, 3], or of faces [1 or N, F, 3]."""
        count, vertex_count = faces.shape[0], vertices.shape[1]
        if face_colors is None:
            if colors is None:
                return torch.ones(1, vertex_count, 3, dtype=torch.float32)
            return _batched(_arguments.floats("colors", colors, [(vertex_count, 3), ("N", vertex_count, 3)], copy))
        return _batched(_arguments.floats("face_colors", face_colors, [(count, 3), ("N", count, 3)], copy))

    def _smoothing(self, given, copy):
        """(settings, names of the tensors, their numbers)."""
        texts, names, numbers = list(self._texts), [], [torch.empty(0, dtype=torch.float32)]
        for name, value in given.items():
            if isinstance(value, torch.Tensor):
                names.append(name)
                numbers.append(_arguments.floats(name, value, [(), (1,)], copy).reshape(1))
            elif value is not None:
                texts.append(f"{name}={value}")
        return texts, names, torch.cat(numbers)


def _batched(tensor):
    return tensor if tensor.dim() == 3 else tensor[None]


_OF_A_CALL = tuple(Renderer.__call__.__kwdefaults__)


def render(vertices, faces, views, intrinsics, *, width, height, device="", **arguments):
    """Renderer(width, height, device=device, ...) and its call in one, with the keywords of both: see there."""
    of_call = {name: value for name, value in arguments.items() if name in _OF_A_CALL}
    settings = {name: value for name, value in arguments.items() if name not in _OF_A_CALL}
    return Renderer(width, height, device=device, **settings)(vertices, faces, views, intrinsics, **of_call)


def subdivide(vertices, faces, views, intrinsics, *, width, height, texcoords=None, face_texcoords=None,
              tolerance=0.25, copy=False, **settings):
    """Renderer(width, height, **settings).subdivide(): see there."""
    return Renderer(width, height, **settings).subdivide(vertices, faces, views, intrinsics, texcoords=texcoords,
                                                         face_texcoords=face_texcoords, tolerance=tolerance, copy=copy)


def release():
    """Frees what is kept on devices for later calls; what graphs hold stays."""
    torch.ops.dpr._release()
