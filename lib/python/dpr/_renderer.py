"""Renderer, and render() in one call."""
from __future__ import annotations

import inspect
import types
from typing import Any, Callable, Dict, Iterable, Mapping, Optional, Sequence, Tuple, Union

import numpy as np

from . import _arrays, _frames, _library, _numpy, _plan, _samples
from ._samples import Samples
from ._subdivision import Subdivision, corner_texcoords

Array = Any
"""Array of NumPy, PyTorch, JAX, or any library with DLPack."""
Meshes = Union[Array, Sequence[Array]]
"""An array, or a list of one a mesh."""
Setting = Union[float, str, None]


class Renderer:
    """Settings that stay the same from call to call: image size, smoothing, clipping, culling, shading, device.

    width, height   of the images, pixels, 1 to 16384
    device          OpenCL device: "" for DPR_DEVICE or else the best there is, "cpu", "gpu", a number, or a part of
                    a name (dpr.devices())
    settings        any key of a scene's "smoothing" (lib/cli/README.md), with a number or a word: preset ("pixel"
                    unless given), sigma, gamma, samples, ...; and
        blur        instead of sigma: the standard deviation of the edges' noise in pixels, so that
                    sigma = (2 blur / short side of the image)^2, in squared NDC, or the root of that with Euclidean
                    distances. 1 unless sigma or another preset than "pixel" is given
        znear, zfar world units, between which triangles are rendered. Left out, every view has powers of two around the
                    depths of its vertices, the near one at least 1/1024 of the far one. Triangles are clipped
                    at both planes, those that cross both at znear alone.
        cull        "none", "back" or "front"
        shading, shininess  of lights: "phong", "blinn", "gouraud", "flat" or "microfacet", which is glTF's reflection of
                    colors (1 - metallic) and materials of specular F0 and shininess 2 / roughness**4 - 1; 64 unless given

    Settings may be changed later, as attributes: renderer.blur = 0.5. Unknown names are refused, and so is a
    setting that the smoothing does not use: sigma of the preset "rigid", alpha of the joint composition,
    samples of an exact estimator. A Renderer is pickled with its settings. Devices are opened, and kernels built, by
    the first call in a process. Several threads may render with it at once. OpenCL does not survive fork(): a process
    forked after that gets an error from a call; start it with "spawn", or render in the parent later. Frames of a graph
    hold buffers on the device until the graph is freed; some buffers are kept for later calls with the same faces and
    size (release()). An interrupt (Ctrl-C) ends a call when the device has done the mesh under way, or all views of the
    only mesh.
    """

    def __init__(self, width: int, height: int, *, device: Union[str, int] = "", **settings: Setting):
        self._configure({"width": width, "height": height, "device": device, **settings})

    def _configure(self, given):
        """Takes all of a renderer, once it has been checked."""
        _plan.require_names(given, _OF_A_RENDERER)
        given = {"preset": "pixel", **{name: value.item() if _checked(name, value) else value
                                       for name, value in given.items() if value is not None}}
        if "sigma" in given and "blur" in given:
            _arrays.fail(ValueError, "blur", "blur and sigma", "one of them")
        width, height = (_plan.pixels(name, given.pop(name, None)) for name in ("width", "height"))
        device, texts = _plan.device_name(given.pop("device", "")), []
        has_blur = "sigma" in given or "blur" in given or given.get("preset") != "pixel"
        for name, value in (given if has_blur else {**given, "blur": _DEFAULT_BLUR}).items():
            if name == "blur":
                of_blur = _plan.power_of_blur(given, width, height)
                name, value = "sigma", _plan.sigma_of_blur(value, *of_blur)
            texts.append(_plan.setting(name, value))
        if not _arrays.is_compiling():
            _library.call("dpr_frame_check", _frames.options_of(_spec_of(device, width, height, texts)))
        for name, value in (("width", width), ("height", height), ("device", device), ("_settings", given),
                            ("_texts", texts)):
            object.__setattr__(self, name, value)

    @property
    def settings(self) -> Mapping[str, Setting]:
        """Settings that were given, to read: attributes of a Renderer change them."""
        return types.MappingProxyType(self._settings)

    def __setattr__(self, name: str, value: Setting) -> None:
        """Changes width, height, device or a setting for later calls; None takes a setting back. sigma takes the place of
        blur, and blur of sigma."""
        given = {"width": self.width, "height": self.height, "device": self.device, **self._settings}
        if name in ("sigma", "blur") and value is not None:
            given.pop("blur" if name == "sigma" else "sigma", None)
        self._configure({**given, name: value})

    def __getattr__(self, name: str) -> Setting:
        if name in _OF_A_RENDERER:
            return self._settings.get(name)
        raise AttributeError(f"'Renderer' object has no attribute '{name}'")

    def __repr__(self):
        return f"dpr.Renderer({self.width}, {self.height}, device={self.device!r}, " + \
            ", ".join(f"{name}={value!r}" for name, value in self._settings.items()) + ")"

    def __call__(self, vertices: Meshes, faces: Meshes, views: Array, intrinsics: Array, *,
                 colors: Optional[Meshes] = None, face_colors: Optional[Meshes] = None, opacities: Optional[Meshes] = None,
                 face_opacities: Optional[Meshes] = None, texcoords: Optional[Meshes] = None,
                 face_texcoords: Optional[Meshes] = None, textures: Any = None, face_textures: Optional[Meshes] = None,
                 wrap: Union[str, Sequence[str]] = "repeat", filter: Union[str, Sequence[str]] = "bilinear",
                 materials: Any = None, face_materials: Optional[Meshes] = None, background: Optional[Array] = None,
                 lights: Optional[Dict[str, Array]] = None, sigma: Union[float, Array, None] = None,
                 blur: Union[float, Array, None] = None, gamma: Union[float, Array, None] = None,
                 alpha: Union[float, Array, None] = None, outputs: Iterable[str] = (), copy: bool = False,
                 **misspelt: Any) -> Any:
        """Renders N views of one mesh, of N shapes of one topology, or of N meshes, or one view of N.

        vertices     [V, 3] or [N, V, 3], world space
        faces        [F, 3], int64 or int32: indices of vertices
        views        [N, 4, 4], world to camera, acting on column vectors; the camera looks down -z, y is up (OpenGL).
                     dpr.look_at(), dpr.perspective() and dpr.cameras make views and intrinsics. One of either, with or
                     without the first dimension, and one mesh go with N of the others
        intrinsics   [N, 4], fx, fy, cx, cy in pixels from the corner of the top-left pixel (OpenCV's cx and cy plus
                     0.5); [N, 9], the same and OpenCV's k1, k2, p1, p2, k3; [N, 8], the same and its fisheye's k1 to
                     k4; [N, 1], orthographic: world units from the lower to the upper edge
        colors       [V, 3] or [N, V, 3], linear RGB of the vertices; or
        face_colors  [F, 3] or [N, F, 3], of the faces; white without either
        opacities    [V], from 0 to 1, of the vertices; or face_opacities [F], of the faces; opaque without. Below 1 outputs
                     with gradients are refused. The barrier composition (the preset "softras" say) hardly heeds them
        texcoords    of textures: (u, v), v up, of the vertices [V, 2], of the faces' corners [F, 3, 2], or [T, 2] with
        face_texcoords  [F, 3], int64 or int32: their indices
        textures     [H, W, 3], linear RGB, row 0 on top, or a list of such of any sizes; [N, H, W, 3]: of each view by
                     itself. Colours multiply them. Of [H, W, 4] the fourth channel is opacity, which opacities multiply
        face_textures   [F], int64 or int32: the faces' textures, -1 for none; all have the first unless given
        wrap         "repeat", "mirror" or "clamp", what lies beyond [0, 1]; a word, or a list of one a texture
        filter       "nearest", "bilinear" or "trilinear", which has a pyramid of smaller images; likewise
        materials    a dictionary: "specular" [M, 3] multiplies highlights, "shininess" [M]. Without, 1 (by microfacets a
                     white metal, without colours) and the lights'. face_materials [F]: the faces', all the first without
        background   [3], linear RGB; black unless given. A picture: image[..., :3] + (1 - image[..., 3:]) * picture
        lights       a dictionary, with what it names: "ambient" [3] (0.5 if left out), "harmonics" [9, 3], "point"
                     [L, 9] (position, diffuse, specular), "directional" [L, 9] (direction, diffuse, specular), "spot"
                     [L, 14] (position, direction, angle and inner angle in degrees, diffuse, specular), directions away
                     from the light; with N in front of each view by itself. Without a dictionary colours are as they are.
        sigma or blur, gamma, alpha   instead of the settings': numbers, or tensors of one number
        outputs      names of "depth", "position", "normal", "texcoords", "face_id", "barycentrics", "uv",
                     "effective_faces". The first four are those of what may cover a pixel, at full size wherever alpha
                     is above 0: weigh them by alpha
        copy         whether tensors on other devices are copied to the CPU, and the images back

        Meshes of different topology are lists, one mesh a view: of [V_i, 3], of [F_i, 3], and likewise of their
        colours, textures (each a tensor or a list) and materials, with None for a mesh without; words and a dictionary
        may be those of all. Or they are padded, faces [N, F, 3] with -1 behind a mesh's last face and vertices [N, V,
        3]. A mesh without faces shows the background. Those of alike sizes share their launches; with Monte Carlo
        they are rendered one after the other.

        Arrays are of NumPy, PyTorch, JAX, or any library with DLPack, and what is returned is of the same, float32;
        nested lists of numbers are NumPy's. float32, int64 and int32 are read where they are, if packed and on the CPU;
        other floating-point numbers and integers are converted, and have gradients of their own type. With PyTorch and
        JAX the result is a function of them with first derivatives; vjp() has those of all others.

        Returns the images [N, height, width, 4]: linear RGB over the background, which is not to be blended by alpha
        again, and alpha, the silhouette. With outputs, (images, {name: tensor}): depth [N, height, width] along the
        view direction, world units; position and normal [N, height, width, 3], world space; texcoords [N, height,
        width, 2]; all of these the mean by the faces' weights (the normal at length 1), 0 where these sum to less than
        1e-12. face_id [N, height, width], int64, of the face that weighs most, -1 on the background; barycentrics [N,
        height, width, 3] and uv [N, height, width, 2] of that face; effective_faces, how many faces share a pixel.

        The images have first derivatives with respect to every float array above. Views may be any affine matrices, but
        with lights their derivatives are those of rigid motions. Depth, position, normal and texcoords have derivatives
        with respect to vertices, views (rigid motions), intrinsics, sigma, gamma, alpha and texture coordinates, of
        what is shown and of how much of it is seen; each costs about an image, normals four. The other outputs have
        none. Errors name the argument: TypeError of what is no such array, ValueError (dpr.InvalidArgument) of shapes
        and of what arrays hold, dpr.DeviceError of OpenCL; but from within torch.compile and JAX's jit they come as
        those have them. A UserWarning tells that every triangle was dropped, or some beyond the zfar that was set, but
        not from within torch.compile.
        """
        _plan.require_names(misspelt, _OF_A_CALL)
        spec, plan = self._plan(vertices, faces, views, intrinsics, {
            "colors": colors, "face_colors": face_colors, "opacities": opacities, "face_opacities": face_opacities,
            "texcoords": texcoords, "face_texcoords": face_texcoords, "textures": textures, "face_textures": face_textures,
            "wrap": wrap, "filter": filter, "materials": materials, "face_materials": face_materials, "background": background,
            "lights": lights, "sigma": sigma, "blur": blur, "gamma": gamma, "alpha": alpha, "outputs": outputs, "copy": copy})
        kinds = {_arrays.module_of(leaf) for leaf in plan.leaves}
        if "torch" in kinds:
            from . import _torch
            found, warning = _torch.render(spec, plan.leaves, copy)
        elif "jax" in kinds:
            from . import _jax
            found, warning = _jax.render(spec, plan.leaves), None
        else:
            rendered = _frames.Rendered(spec, [_arrays.to_numpy(leaf) for leaf in plan.leaves], ())
            found, warning = [_arrays.like(plan.given[0], array) for array in rendered.outputs], rendered.warning
        return _result(spec, found, warning)

    def jvp(self, vertices: Meshes, faces: Meshes, views: Array, intrinsics: Array, *, tangents: Dict[str, Any],
            **arguments: Any) -> Tuple[Any, Array]:
        """Result of a call, and derivatives of the images along K directions at once: forward mode.

        The arguments are those of a call. tangents: by names of arguments, how fast each number of theirs changes,
        [K, *the argument's shape], K the same in all; lists and dictionaries as the argument. Other arguments stay.

        Returns (result, tangents [K, N, height, width, 4]), exact, and the transpose of vjp(). Directions share most of
        the work: with the image, one costs up to three images, six up to five. Images have tangents along vertices,
        colors, face_colors, opacities, face_opacities, views, intrinsics, background, sigma, blur, gamma and alpha;
        with noise on the pixel (the preset "pixel") not along sigma and blur. Raises ValueError (dpr.InvalidArgument)
        for other arrays, Monte Carlo, outputs with gradients, and other shapes. PyTorch and JAX take their own tangents
        by torch.func.jvp, torch.autograd.forward_ad and jax.jvp.

            image, tangents = renderer.jvp(vertices, faces, views, intrinsics, tangents={"vertices": directions})
            matrix, vector = dpr.normal_equations(tangents, image - target)
            vertices -= np.tensordot(np.linalg.solve(matrix, vector), directions, 1)  # Gauss-Newton
        """
        _plan.require_names(arguments, _OF_A_CALL)
        spec, plan = self._plan(vertices, faces, views, intrinsics, {**_DEFAULTS, **arguments})
        found, tangents, warning = _numpy.jvp(spec, plan, tangents)
        return _result(spec, found, warning), tangents

    def vjp(self, vertices: Meshes, faces: Meshes, views: Array, intrinsics: Array, *,
            wrt: Optional[Iterable[str]] = None, **arguments: Any) -> Tuple[Any, Callable[..., Dict[str, Any]]]:
        """Result of a call, and a function from gradients of the result to gradients of the call's arrays.

        The arguments are those of a call. wrt: names of those whose gradients are wanted, ("vertices", "lights") say;
        all float arrays that are given unless it says otherwise.

        Returns (result, pullback). pullback(image=grad_image, depth=grad_depth, ...) takes the gradient of the images, or
        None, and those of outputs that have some, and returns a dictionary of arrays by the names of the arguments: of a list
        a list, of lights and materials dictionaries. It may be called again; the frame's buffers stay on the device as
        long as it is there. Raises ValueError for a name that is none of these, and another shape.

            image, pullback = renderer.vjp(vertices, faces, views, intrinsics, wrt=["vertices"])
            gradient = pullback(2 * (image - target) / image.size)["vertices"]
        """
        _plan.require_names(arguments, _OF_A_CALL)
        spec, plan = self._plan(vertices, faces, views, intrinsics, {**_DEFAULTS, **arguments})
        found, pullback, warning = _numpy.vjp(spec, plan, wrt)
        return _result(spec, found, warning), pullback

    @_arrays.named("dpr.rasterize")
    def rasterize(self, vertices: Meshes, faces: Meshes, views: Array, intrinsics: Array, *, parts: Optional[Meshes] = None,
                  layers: int = 1, copy: bool = False, **misspelt: Any) -> Samples:
        """What the samples of the rigid image show, for shading of the caller's own with noise on the pixel around it.

        The arguments are those of a call: one mesh, N shapes, a list of N meshes, or N padded ones, which share launches.
        parts: [F], or [N, F] of padded meshes, numbers of the parts that faces belong to (materials, charts, np.arange(F)).
        Shading that jumps has gradients between parts, and at contours, where one surface hides another.
        layers: how many of each sample's surfaces to tell apart, 1 to 256, for shading that sees through them.

        Returns Samples: face_id, barycentrics and depth of every sample. interpolate() has the vertices' attributes there;
        resolve() makes images of values with any number of channels, with derivatives by vertices, views and intrinsics as
        the library's own images have them. Of the surfaces at a sample the nearest `layers` count, each by Samples.layers:
        what is blended of them follows also the contours that fewer surfaces hide. Where two cut through one another, their
        line has no gradient; nor has sigma. Raises ValueError (dpr.InvalidArgument) for another preset than "pixel".

            samples = renderer.rasterize(vertices, faces, views, intrinsics)
            normals = samples.interpolate(vertex_normals)
            image = samples.resolve(my_shader(normals))  # [N, height, width, C]
        """
        _plan.require_names(misspelt, ("parts", "layers", "copy"))
        return _samples.rasterize(*self._plan_samples(vertices, faces, views, intrinsics, layers, copy, parts), copy)

    def _plan_samples(self, vertices, faces, views, intrinsics, layers, copy=False, parts=None):
        given = {**_DEFAULTS, "face_colors": _samples.colors_of_parts(parts, faces), "copy": copy}
        spec, plan = self._plan(vertices, faces, views, intrinsics, given, as_one=True)
        return spec._replace(settings=(*spec.settings, _plan.setting("layers", layers))), plan

    @_arrays.named("dpr.subdivide")
    def subdivide(self, vertices: Array, faces: Array, views: Array, intrinsics: Array, *,
                  texcoords: Optional[Array] = None, face_texcoords: Optional[Array] = None, tolerance: float = 0.25,
                  copy: bool = False) -> Subdivision:
        """Cuts a mesh's faces where lenses bend their edges, which images draw straight between vertices.

        vertices [V, 3], and faces, views and intrinsics as a call takes them. Edges are halved until no view shows a point of
        one further than `tolerance` pixels from where it is drawn, for all faces at them, also between vertices that only
        coincide. Without lenses nothing is cut. The result is right for meshes and cameras near these: cut again when they
        have moved. With lights, normals are those of the pieces: new vertices have their face's own, so that what coarse
        faces shade smoothly gets flat within them.

        texcoords and face_texcoords, as a call takes them, come back as the pieces': `texcoords` [F', 3, 2] of the result,
        with gradients of the given ones.

        Returns a Subdivision: its faces and of_vertices(vertices) are to be rendered. The cut itself has no derivative.
        """
        plan = _plan.Plan(copy)
        plan.add(("vertices",), vertices)
        plan.add(("faces",), faces, True)
        plan.repeat_camera(plan.add_camera(views, intrinsics))
        _, _, tolerance = _plan.setting("tolerance", tolerance).partition("=")
        arrays = [(name, np.ascontiguousarray(_arrays.to_numpy(leaf))) for (name,), leaf in zip(plan.paths, plan.leaves)]
        cut = Subdivision(self._spec(), arrays, float(tolerance), plan.given[0])
        if texcoords is None:
            if face_texcoords is not None:
                _arrays.fail(ValueError, "face_texcoords", "them alone", "them beside texcoords")
            return cut
        plan.add(("texcoords",), texcoords)
        corners = corner_texcoords(plan.given[-1], face_texcoords, arrays[1][1], arrays[0][1].shape[0])
        cut.texcoords = cut.of_corners(corners)
        return cut

    def _spec(self):
        return _spec_of(self.device, self.width, self.height, self._texts)

    def _plan(self, vertices, faces, views, intrinsics, given, as_one=False):
        mesh = {"vertices": vertices, "faces": faces, **{name: given[name] for name in _OF_A_MESH}}
        smoothing = {name: given[name] for name in ("sigma", "blur", "gamma", "alpha")}
        return _plan.of_call(self, mesh, views, intrinsics, given["background"], given["lights"], smoothing,
                             given["outputs"], given["copy"], as_one)


def _result(spec, found, warning):
    """What a caller gets, who is told the warning."""
    if warning:
        _library.warn(warning)
    return (found[0], dict(zip(spec.outputs, found[1:]))) if spec.outputs else found[0]


def _spec_of(device, width, height, texts):
    """Spec without arrays of a call."""
    return _frames.Spec(device, width, height, 0, tuple(texts), (), ())


def _checked(name, value):
    """True if a setting is an array, of one number then."""
    return _arrays.is_array(value) and bool(_plan.setting(name, value))


_DEFAULT_BLUR = 1  # pixels, of the preset "pixel"
_DEFAULTS = Renderer.__call__.__kwdefaults__
_OF_A_CALL = tuple(_DEFAULTS)
_OF_A_MESH = _OF_A_CALL[:_OF_A_CALL.index("background")]
_SETTINGS = tuple(name for name in ("blur", *_library.setting_names) if name not in (*_OF_A_MESH, "layers"))
_OF_A_RENDERER = ("width", "height", "device", *_SETTINGS)


def _split(arguments):
    """(settings, keywords of a call)"""
    _plan.require_names(arguments, (*_SETTINGS, *_OF_A_CALL))
    return ({name: value for name, value in arguments.items() if name not in _OF_A_CALL},
            {name: value for name, value in arguments.items() if name in _OF_A_CALL})


def render(vertices: Meshes, faces: Meshes, views: Array, intrinsics: Array, *, width: int, height: int,
           device: Union[str, int] = "", **arguments: Any) -> Any:
    """Renderer(width, height, device=device, ...) and its call in one, with the keywords of both.

    """
    settings, of_call = _split(arguments)
    return Renderer(width, height, device=device, **settings)(vertices, faces, views, intrinsics, **of_call)


def render_with_jvp(vertices: Meshes, faces: Meshes, views: Array, intrinsics: Array, *, width: int, height: int,
                    tangents: Dict[str, Any], device: Union[str, int] = "", **arguments: Any) -> Tuple[Any, Array]:
    """Renderer(width, height, device=device, ...) and its jvp() in one, with the keywords of both: see there."""
    settings, of_call = _split(arguments)
    return Renderer(width, height, device=device, **settings).jvp(vertices, faces, views, intrinsics, tangents=tangents,
                                                                  **of_call)


def render_with_vjp(vertices: Meshes, faces: Meshes, views: Array, intrinsics: Array, *, width: int, height: int,
                    device: Union[str, int] = "", wrt: Optional[Iterable[str]] = None,
                    **arguments: Any) -> Tuple[Any, Callable[..., Dict[str, Any]]]:
    """Renderer(width, height, device=device, ...) and its vjp() in one, with the keywords of both: see there."""
    settings, of_call = _split(arguments)
    return Renderer(width, height, device=device, **settings).vjp(vertices, faces, views, intrinsics, wrt=wrt, **of_call)


@_arrays.named("dpr.rasterize")
def rasterize(vertices: Meshes, faces: Meshes, views: Array, intrinsics: Array, *, width: int, height: int,
              parts: Optional[Meshes] = None, layers: int = 1, copy: bool = False, **settings: Setting) -> Samples:
    """Renderer(width, height, **settings).rasterize(): see there."""
    _plan.require_names(settings, (*_OF_A_RENDERER, "parts", "layers", "copy"))
    return Renderer(width, height, **settings).rasterize(vertices, faces, views, intrinsics, parts=parts, layers=layers,
                                                         copy=copy)


def subdivide(vertices: Array, faces: Array, views: Array, intrinsics: Array, *, width: int, height: int,
              texcoords: Optional[Array] = None, face_texcoords: Optional[Array] = None, tolerance: float = 0.25,
              copy: bool = False, **settings: Setting) -> Subdivision:
    """Renderer(width, height, **settings).subdivide(): see there."""
    return Renderer(width, height, **settings).subdivide(vertices, faces, views, intrinsics, texcoords=texcoords,
                                                         face_texcoords=face_texcoords, tolerance=tolerance, copy=copy)


def _keywords_of(function):
    return [parameter for parameter in inspect.signature(function).parameters.values()
            if parameter.kind == inspect.Parameter.KEYWORD_ONLY]


def _sign(function, *more):
    """Lists more keywords in a function's signature, in the place of those that it passes on."""
    signature = inspect.signature(function)
    own = [parameter for parameter in signature.parameters.values() if parameter.kind != inspect.Parameter.VAR_KEYWORD]
    names = {parameter.name for parameter in own}
    function.__signature__ = signature.replace(
        parameters=own + [parameter for parameter in more if parameter.name not in names])


_setting_keywords = [inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, annotation="Setting",
                                       default="pixel" if name == "preset" else None) for name in _SETTINGS]
_call_keywords = _keywords_of(Renderer.__call__)
_sign(Renderer.__init__, *_setting_keywords)
_sign(Renderer.__call__)
_sign(Renderer.rasterize)
_sign(Renderer.jvp, *_call_keywords)
_sign(Renderer.vjp, *_call_keywords)
_all_keywords = {parameter.name: parameter for parameter in (*_setting_keywords, *_call_keywords)}
for _function in (render, render_with_jvp, render_with_vjp):
    _sign(_function, *_all_keywords.values())
_sign(rasterize, *_keywords_of(Renderer.__init__))
_sign(subdivide, *_keywords_of(Renderer.__init__))
render.__doc__ += Renderer.__doc__ + "\n    The call:\n\n" + Renderer.__call__.__doc__
