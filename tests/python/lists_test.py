"""Unlike meshes in one call of the Python package `dpr`: one frame has what as many have, each mesh by itself."""
import sys
import unittest
from unittest import mock

try:
    import numpy as np
except ImportError:
    print("skipped: no python3-numpy")
    sys.exit(0)

import dpr
from dpr import _frames, _merged

SIZE = 24
NOISES = {"pixel": {"preset": "pixel", "blur": 0.7}, "joint": {"preset": "joint_gaussian", "sigma": 1e-3, "gamma": 0.05},
          "barrier": {"preset": "gaussian", "sigma": 1e-3, "gamma": 0.05}}
RANDOM = np.random.default_rng(3)


def random(*shape):
    return RANDOM.random(shape, np.float32)


def sphere(rings, sectors):
    """A closed mesh, with one vertex a pole and others in rings."""
    angles = np.pi * np.arange(1, rings) / rings
    turns = 2 * np.pi * np.arange(sectors) / sectors
    ring = np.stack([np.sin(angles)[:, None] * np.cos(turns), np.repeat(np.cos(angles)[:, None], sectors, 1),
                     -np.sin(angles)[:, None] * np.sin(turns)], -1).reshape(-1, 3)
    vertices = np.concatenate([[[0, 1, 0]], ring, [[0, -1, 0]]]).astype(np.float32)
    faces = []
    for k in range(sectors):
        following = (k + 1) % sectors
        faces.append([0, 1 + k, 1 + following])
        for row in range(rings - 2):
            a, b = 1 + row * sectors + k, 1 + row * sectors + following
            faces += [[a, a + sectors, b], [b, a + sectors, b + sectors]]
        last = 1 + (rings - 2) * sectors
        faces.append([len(vertices) - 1, last + following, last + k])
    return vertices + 0.05 * random(*vertices.shape), np.array(faces)


def split(vertices, faces):
    """The same with vertices of each face by itself: edges lie in one place, and are joined there."""
    return vertices[faces].reshape(-1, 3), np.arange(faces.size).reshape(-1, 3)


MESHES = [sphere(4, 5), split(*sphere(3, 6)), sphere(5, 7), sphere(3, 4)]
VERTICES, FACES = [vertices for vertices, _ in MESHES], [faces for _, faces in MESHES]
VIEWS = np.concatenate([dpr.look_at([np.sin(turn), 0.5, 3 * np.cos(turn)]) for turn in (0.1, 0.4, 0.7, 1.0)])
LENS = dpr.perspective(40, SIZE, SIZE)
LIGHTS = {"ambient": np.float32([0.3, 0.3, 0.3]), "point": np.float32([[1, 2, 4, 0.5, 0.5, 0.5, 0.4, 0.4, 0.4]])}

LIGHTS_OF_VIEWS = {"ambient": 0.4 * random(4, 3), "harmonics": 0.2 * random(4, 9, 3),
                   "point": random(4, 2, 9) * np.float32([4, 4, 4, 1, 1, 1, 1, 1, 1]), "directional": random(1, 9) - 1,
                   "spot": np.concatenate([random(4, 1, 3) + 2, -2 - random(4, 1, 3), 20 + 9 * random(4, 1, 1),
                                           5 + 9 * random(4, 1, 1), random(4, 1, 6)], -1)}
"""The directional light is that of all views."""


def of_each(shape_of, make=random):
    return [make(*shape_of(vertices, faces)) for vertices, faces in MESHES]


def textured():
    materials = [{"specular": random(2, 3), "shininess": 3 + random(2)} for _ in MESHES]
    return {"texcoords": [random(len(VERTICES[0]), 2), random(len(FACES[1]), 3, 2), random(9, 2), random(len(VERTICES[3]), 2)],
            "face_texcoords": [None, None, RANDOM.integers(0, 9, (len(FACES[2]), 3)), None],
            "textures": [[random(5, 4, 3)], [random(3, 7, 3), random(2, 2, 3)], [random(6, 6, 3)], [random(4, 4, 3)]],
            "face_textures": [None, RANDOM.integers(-1, 2, len(FACES[1])), None, None],
            "wrap": [["mirror"], ["clamp", "repeat"], ["repeat"], ["mirror"]], "filter": "trilinear",
            "materials": materials, "face_materials": of_each(lambda _, f: (len(f),), lambda n: RANDOM.integers(0, 2, n))}


VARIANTS = {
    "white": {},
    "colours of vertices": {"colors": of_each(lambda v, f: (len(v), 3))},
    "colours of faces": {"face_colors": of_each(lambda v, f: (len(f), 3))},
    "flat light": {"lights": LIGHTS, "shading": "flat", "colors": of_each(lambda v, f: (len(v), 3))},
    "smooth light": {"lights": LIGHTS, "shading": "phong", "face_colors": of_each(lambda v, f: (len(f), 3))},
    "materials and colours": {"lights": LIGHTS, "shading": "blinn", "colors": of_each(lambda v, f: (len(v), 3)),
                              **{name: textured()[name] for name in ("materials", "face_materials")}},
    "textures": textured(),
    "textures in the light": {"lights": LIGHTS, "shading": "gouraud", **textured()},
    "lights of views": {"lights": LIGHTS_OF_VIEWS, "shading": "blinn", "colors": of_each(lambda v, f: (len(v), 3))},
    "opacities of vertices": {"opacities": of_each(lambda v, f: (len(v),)), "colors": of_each(lambda v, f: (len(v), 3))},
    "opacities of faces": {"face_opacities": of_each(lambda v, f: (len(f),)), "face_colors": of_each(lambda v, f: (len(f), 3))},
    "see-through textures": {**textured(), "textures": [[random(5, 4, 4)], [random(3, 7, 4), random(2, 2, 3)],
                                                        [random(6, 6, 4)], [random(4, 4, 4)]]},
    "near the camera": {"colors": of_each(lambda v, f: (len(v), 3)), "znear": 2.3, "zfar": 3.5},
}


def flat(value):
    """Arrays of nested lists and dictionaries, in order."""
    if isinstance(value, dict):
        value = list(value.values())
    if isinstance(value, (list, tuple)):
        return [array for item in value for array in flat(item)]
    return [] if value is None else [value]


def rendered(arguments, noise, is_merged, outputs=()):
    """(images, outputs, gradients, number of frames)"""
    given = dict(arguments)
    settings = {name: given.pop(name) for name in ("shading", "znear", "zfar") if name in given}
    renderer = dpr.Renderer(SIZE, SIZE, **NOISES[noise], **settings)
    frames = []
    render = _frames.Frame.__init__

    def counted(self, *arguments):
        frames.append(self)
        return render(self, *arguments)

    alone = mock.patch.object(_merged, "groups_of", lambda spec, frames, arrays: [[i] for i in range(len(frames))])
    with mock.patch.object(_frames.Frame, "__init__", counted):
        if not is_merged:
            alone.start()
        try:
            found, pullback = renderer.vjp(VERTICES, FACES, VIEWS, LENS, outputs=outputs, **given)
        finally:
            mock.patch.stopall()
        image, others = found if outputs else (found, {})
        grads = {name: np.cos(np.arange(array.size, dtype=np.float32)).reshape(array.shape)
                 for name, array in others.items() if name in _frames.WITH_GRADIENTS}
        grad = np.sin(np.arange(image.size, dtype=np.float32)).reshape(image.shape)
        return image, others, pullback(grad, **grads), len(frames)


class ListsTest(unittest.TestCase):
    def assert_close(self, found, expected, tolerance, what):
        scale = max(np.abs(expected).max(), 1e-3)
        self.assertLess(np.abs(found - expected).max() / scale, tolerance, what)

    def test_one_frame_has_what_each_has_alone(self):
        for noise in NOISES:
            for name, arguments in VARIANTS.items():
                with self.subTest(noise=noise, variant=name):
                    image, _, gradients, count = rendered(arguments, noise, True)
                    expected, _, of_each_alone, count_alone = rendered(arguments, noise, False)
                    self.assertEqual((count, count_alone), (1, 4))
                    self.assertGreater(np.abs(expected).max(), 0.2)
                    self.assert_close(image, expected, 1e-6, name)
                    for found, other in zip(flat(gradients), flat(of_each_alone)):
                        self.assertEqual(found.shape, other.shape)
                        self.assert_close(found, other, 2e-5, name)

    def test_lights_of_views_share_a_frame(self):
        """See-through too, and with outputs that have gradients, unlike lists."""
        mesh = {"vertices": VERTICES[0], "faces": FACES[0]}
        others = {"views": VIEWS, "intrinsics": LENS, "face_colors": random(len(FACES[0]), 3)}
        light_of = [{name: array if name == "directional" else array[i]
                     for name, array in LIGHTS_OF_VIEWS.items()} for i in range(4)]
        grad = np.sin(np.arange(4 * SIZE * SIZE * 4, dtype=np.float32)).reshape(4, SIZE, SIZE, 4)
        for case, given, settings in (("opacities", {"opacities": random(len(VERTICES[0]))}, {"sigma": 1e-3}),
                                      ("opacities", {"opacities": random(len(VERTICES[0]))}, NOISES["pixel"]),
                                      ("outputs", {"outputs": ["depth"]}, {"sigma": 1e-3})):
            renderer = dpr.Renderer(SIZE, SIZE, shading="phong", **settings)
            with self.subTest(case=case), mock.patch.object(_frames, "Frame", wraps=_frames.Frame) as frame:
                image, pullback = renderer.vjp(**mesh, **others, lights=LIGHTS_OF_VIEWS, **given)
                self.assertEqual(frame.call_count, 1)
                found = pullback(grad, **{name: grad[..., 0] for name in given.get("outputs", ())})
                image = image[0] if "outputs" in given else image
            total = {name: np.zeros_like(array) for name, array in LIGHTS_OF_VIEWS.items()}
            vertices = np.zeros_like(VERTICES[0])
            for i in range(4):
                own = {**others, "views": VIEWS[i:i + 1]}
                alone, pullback = renderer.vjp(**mesh, **own, lights=light_of[i], **given)
                one = grad[i:i + 1]
                of_view = pullback(one, **{name: one[..., 0] for name in given.get("outputs", ())})
                self.assert_close(image[i:i + 1], alone[0] if "outputs" in given else alone, 1e-6, case)
                vertices += of_view["vertices"]
                for name, array in of_view["lights"].items():
                    target = total[name] if total[name].shape == array.shape else total[name][i]
                    target += array
            self.assert_close(found["vertices"], vertices, 1e-5, case)
            for name, array in total.items():
                self.assert_close(found["lights"][name], array, 1e-5, name)

    def test_tangents_in_lights_of_views(self):
        renderer = dpr.Renderer(SIZE, SIZE, shading="gouraud", sigma=1e-3)
        given = {"lights": LIGHTS_OF_VIEWS, "colors": random(len(VERTICES[2]), 3)}
        moved = random(1, *VERTICES[2].shape) - 0.5
        _, tangent = renderer.jvp(VERTICES[2], FACES[2], VIEWS, LENS, tangents={"vertices": moved}, **given)
        _, pullback = renderer.vjp(VERTICES[2], FACES[2], VIEWS, LENS, wrt=["vertices"], **given)
        grad = np.sin(np.arange(tangent.size, dtype=np.float32)).reshape(tangent.shape[1:])
        self.assert_close(np.sum(tangent[0].astype(np.float64) * grad),
                          np.sum(pullback(grad)["vertices"].astype(np.float64) * moved[0]), 1e-5, "adjoint")

    def test_wrong_lights_of_views(self):
        with self.assertRaisesRegex(ValueError, r"lights.point .*got \[3, 2, 9\], expected .*\[4, L, 9\] of each view"):
            dpr.render(VERTICES[0], FACES[0], VIEWS, LENS, width=SIZE, height=SIZE,
                       lights={"point": LIGHTS_OF_VIEWS["point"][:3]})
        wrong = LIGHTS_OF_VIEWS["spot"].copy()
        wrong[2, 0, 6] = 500
        with self.assertRaisesRegex(ValueError, r"angle_degrees \(lights.spot\[0\]\) \(view 2\): got"):
            dpr.render(VERTICES[0], FACES[0], VIEWS, LENS, width=SIZE, height=SIZE, lights={"spot": wrong})

    def test_outputs(self):
        outputs = ["face_id", "barycentrics", "effective_faces"]
        for noise in NOISES:
            (_, found, _, count), (_, expected, _, _) = (rendered({}, noise, merged, outputs) for merged in (True, False))
            self.assertEqual(count, 1)
            np.testing.assert_array_equal(found["face_id"], expected["face_id"])
            for name in outputs[1:]:
                self.assert_close(found[name], expected[name], 1e-5, name)

    def test_opaque_surfaces_have_outputs_with_gradients(self):
        for name in ("opacities", "face_opacities"):
            ones = [np.ones(len(array), np.float32) for array in (VERTICES if name == "opacities" else FACES)]
            (_, found, _, frames), (_, expected, _, _) = (rendered({name: ones}, "pixel", merged, ["depth"])
                                                          for merged in (True, False))
            self.assertEqual(frames, 1)
            self.assert_close(found["depth"], expected["depth"], 1e-5, name)

    def test_outputs_with_gradients(self):
        outputs = ["depth", "position", "normal", "texcoords", "uv"]
        for noise in NOISES:
            with self.subTest(noise):
                (image, found, gradients, count), (_, expected, of_each_alone, _) = (
                    rendered(VARIANTS["textures"], noise, merged, outputs) for merged in (True, False))
                self.assertEqual(count, 1)
                for name in outputs:
                    self.assertGreater(np.abs(expected[name]).max(), 0.2)
                    self.assert_close(found[name], expected[name], 1e-5, name)
                for found, other in zip(flat(gradients), flat(of_each_alone)):
                    self.assertEqual(found.shape, other.shape)
                    self.assert_close(found, other, 3e-5, noise)

    def test_tangents(self):
        tangents = {"vertices": [random(2, *vertices.shape) for vertices in VERTICES], "views": random(2, 4, 4, 4)}
        for noise in NOISES:
            renderer = dpr.Renderer(SIZE, SIZE, **NOISES[noise])
            for variant in ("colours of vertices", "opacities of vertices", "opacities of faces"):
                given = VARIANTS[variant]
                own = {name: [random(2, *array.shape) for array in arrays] for name, arrays in given.items()}
                with mock.patch.object(_frames, "Frame", wraps=_frames.Frame) as frame:
                    _, moved = renderer.jvp(VERTICES, FACES, VIEWS, LENS, **given, tangents={**tangents, **own})
                    self.assertEqual(frame.call_count, 1)
                for i, (vertices, faces) in enumerate(MESHES):
                    of_mesh = {"vertices": tangents["vertices"][i], "views": tangents["views"][:, i:i + 1],
                               **{name: arrays[i] for name, arrays in own.items()}}
                    _, alone = renderer.jvp(vertices, faces, VIEWS[i:i + 1], LENS, tangents=of_mesh,
                                            **{name: arrays[i] for name, arrays in given.items()})
                    self.assertGreater(np.abs(alone).max(), 1e-3)
                    self.assert_close(moved[:, i:i + 1], alone, 1e-5, noise)

    def test_groups(self):
        def groups(sizes, **arguments):
            meshes, found = [sphere(3, size) for size in sizes], []
            group = _merged.groups_of
            with mock.patch.object(_merged, "groups_of", lambda *given: found.append(group(*given)) or found[-1]):
                dpr.render([vertices for vertices, _ in meshes], [faces for _, faces in meshes],
                           np.repeat(VIEWS[:1], len(sizes), 0), LENS, width=SIZE, height=SIZE, **arguments)
            return found[0]

        self.assertEqual(groups([4, 6, 5]), [[0, 1, 2]])
        self.assertEqual(groups([4, 4000, 5, 3000]), [[0, 2], [1, 3]])
        self.assertEqual(groups([4, 6], estimator="monte_carlo"), [[0], [1]])

    def test_one_texture_for_all(self):
        texture, texcoords = random(4, 4, 3), [random(len(vertices), 2) for vertices in VERTICES]
        renderer = dpr.Renderer(SIZE, SIZE)
        images = [renderer(VERTICES, FACES, VIEWS, LENS, texcoords=texcoords, textures=textures)
                  for textures in (texture, [texture] * 4)]
        self.assertGreater(np.abs(images[0]).max(), 0.1)
        np.testing.assert_array_equal(*images)

    def test_what_is_wrong_with_one_mesh(self):
        """Indices and sizes that the arrays of another mesh would bear."""
        given = textured()
        small, large = 3, 2  # meshes by their size
        cases = {"faces": ("faces", np.where(FACES[small] == 0, len(VERTICES[small]), FACES[small])),
                 "colors": ("colors", random(len(VERTICES[small]) + 1, 3)), "few colors": ("colors", random(3, 3)),
                 "opacities": ("opacities", random(len(VERTICES[small]) + 1)),
                 "column of opacities": ("opacities", random(len(VERTICES[small]), 1)),
                 "texcoords": ("texcoords", random(len(VERTICES[small]) - 1, 2)),
                 "face_textures": ("face_textures", np.ones(len(FACES[small]), np.int64)),
                 "face_materials": ("face_materials", np.full(len(FACES[small]), 2)),
                 "face_texcoords": ("face_texcoords", np.full((len(FACES[small]), 3), len(VERTICES[small])))}
        for name, (array, wrong) in cases.items():
            meshes = {"faces": list(FACES), **{key: list(given[key]) for key in given if key not in ("filter", "colors")}}
            meshes.update({name: list(arrays) for name, arrays in VARIANTS["opacities of vertices"].items()})
            meshes["face_texcoords"][small] = FACES[small]
            renderer = dpr.Renderer(SIZE, SIZE)
            order = [large, small]

            def render():
                renderer(vertices=[VERTICES[i] for i in order], views=VIEWS[:2], intrinsics=LENS,
                         **{key: [of_all[i] for i in order] for key, of_all in meshes.items()})

            render()
            meshes[array][small] = wrong
            with self.subTest(name), self.assertRaisesRegex(ValueError, "view 1"):
                render()

        flat = {"faces": (VERTICES[1], FACES[1][:3, :2]), "vertices": (VERTICES[1][:3, :2], FACES[1][:1])}
        for name, (vertices, faces) in flat.items():
            with self.subTest(name), self.assertRaisesRegex(ValueError, rf"{name} \(view 1\): got \[3, 2\]"):
                dpr.render([VERTICES[0], vertices], [FACES[0], faces], VIEWS[:2], LENS, width=SIZE, height=SIZE)

    def test_what_is_not_finite_is_told_of_its_mesh(self):
        bad = [VERTICES[0], VERTICES[1].copy()]
        bad[1][5] = np.nan
        colors = [np.ones_like(vertices) for vertices in VERTICES[:2]]
        colors[1][2] = np.nan
        given = {"texcoords": [random(len(vertices), 2) for vertices in VERTICES[:2]]}
        cases = {r"vertices\[5\] \(view 1\): got \(nan": (bad, {}),
                 r"colors\[2\] \(view 1\)": (VERTICES[:2], {"colors": colors}),
                 r"textures, texel 1 \(view 0\)": (VERTICES[:2], {**given, "textures": np.float32([[[1] * 3, [np.nan] * 3]])}),
                 r"textures, alpha of texel 0 \(view 0\)": (VERTICES[:2], {**given, "textures": np.float32([[[1, 1, 1, 2]]])})}
        for words, (vertices, arguments) in cases.items():
            with self.subTest(words), self.assertRaisesRegex(dpr.InvalidArgument, words):
                dpr.render(vertices, FACES[:2], VIEWS[:2], LENS, width=SIZE, height=SIZE, **arguments)

    def test_refused(self):
        spec = dpr.Renderer(SIZE, SIZE)._spec()
        faces = np.stack([FACES[0], FACES[0]])
        vertices = np.stack([VERTICES[0], VERTICES[0]])
        given = {"vertices": vertices, "faces": faces, "views": VIEWS[:2], "intrinsics": np.repeat(LENS, 2, 0)}
        count = len(VERTICES[0])

        def frame(**other):
            return _frames.Frame(_frames.options_of(spec), [(name, np.ascontiguousarray(array))
                                                            for name, array in {**given, **other}.items()])

        frame()
        for name, wrong in {"vertices": vertices[0], "faces": np.stack([FACES[0]] * 3), "colors": random(count, 3),
                            "opacities": random(count), "face_colors": random(len(FACES[0]), 3)}.items():
            with self.subTest(name), self.assertRaisesRegex(dpr.InvalidArgument, name):
                frame(**{name: wrong})
        with self.assertRaisesRegex(dpr.InvalidArgument, "face_texcoords"):
            frame(**{"texcoords": random(count, 2), "textures[0]": random(4, 4, 3)})

    def test_a_mesh_that_shows_nothing_is_told(self):
        far = [VERTICES[0], VERTICES[2] + np.float32([0, 99, 0])]
        with self.assertWarnsRegex(UserWarning, r"every triangle was dropped.*\(view 1\)"):
            dpr.render(far, [FACES[0], FACES[2]], VIEWS[:2], LENS, width=SIZE, height=SIZE)


if __name__ == "__main__":
    unittest.main()
