"""What users of the Python package `dpr` do by habit or by mistake: it works, or an error names it. By NumPy alone."""
import _thread
import copy
import inspect
import pickle
import sys
import threading
import unittest
import warnings

try:
    import numpy as np
except ImportError:
    print("skipped: no python3-numpy")
    sys.exit(0)

import dpr
from scenes import FACES, SIZE, SMOOTH, SQUARE, SQUARE_FACES, TETRAHEDRON, cameras, random

MESH = (TETRAHEDRON, FACES)


class ArgumentsTest(unittest.TestCase):
    def test_attributes_of_a_renderer_take_effect(self):
        views = cameras(1)
        renderer = dpr.Renderer(SIZE, SIZE, sigma=1e-3)
        for change in ({"sigma": 2e-2}, {"preset": "joint_gaussian"}, {"gamma": 0.1}, {"width": 20}, {"blur": 0.5},
                       {"znear": 3.5}, {"sigma": 1e-2}, {"gamma": None}):
            before = renderer(*MESH, *views)
            for name, value in change.items():
                setattr(renderer, name, value)
                self.assertEqual(getattr(renderer, name), value)
            image = renderer(*MESH, *views)
            expected = dpr.Renderer(renderer.width, renderer.height, **renderer.settings)(*MESH, *views)
            np.testing.assert_array_equal(image, expected)
            self.assertFalse(image.shape == before.shape and np.array_equal(image, before), change)
        self.assertEqual(dict(renderer.settings), {"preset": "joint_gaussian", "sigma": 1e-2, "znear": 3.5})
        for other in (copy.copy(renderer), pickle.loads(pickle.dumps(renderer))):
            np.testing.assert_array_equal(other(*MESH, *views), image)
            other.sigma = 1e-3
        self.assertEqual(renderer.sigma, 1e-2)
        for name, value, words in (("sigma", -1, "sigma"), ("sigam", 0.1, "did you mean 'sigma'"), ("colors", 1, "name"),
                                   ("preset", "hard", "preset"), ("height", 0, "height"), ("settings", {}, "name")):
            with self.assertRaisesRegex(ValueError, words):
                setattr(renderer, name, value)
        with self.assertRaises(TypeError):
            renderer.settings["sigma"] = 0.1
        with self.assertRaisesRegex(AttributeError, "sigam"):
            renderer.sigam
        np.testing.assert_array_equal(renderer(*MESH, *views), image)

    def test_settings_without_a_part_are_refused(self):
        views = cameras(1)
        for settings, words in [({"preset": "rigid", "sigma": 0.1}, "sigma .* got a value with occupancy_width zero"),
                                ({"preset": "rigid", "blur": 0.5}, "sigma .* got a value with occupancy_width zero"),
                                ({"preset": "rigid", "occupancy_prior": "cauchy"}, "occupancy_prior"),
                                ({"alpha": 2}, "alpha .* got a value with the joint composition"),
                                ({"preset": "joint_gaussian", "background_depth": 0.1}, "background_depth"),
                                ({"composition": "barrier", "alpha": 0.3}, "alpha .* got a value with noise of the pixel"),
                                ({"occupancy_threshold": 0.1}, "occupancy_threshold .* got a value with noise of the pixel"),
                                ({"samples": 64}, "samples .* got a value with the exact estimators"),
                                ({"draws": "antithetic"}, "draws"),
                                ({"preset": "gaussian", "variance_reduction": "none"}, "variance_reduction")]:
            with self.subTest(settings), self.assertRaisesRegex(dpr.InvalidArgument, words):
                dpr.render(*MESH, *views, width=SIZE, height=SIZE, **settings)
        with self.assertRaisesRegex(dpr.InvalidArgument, "sigma .* got a value"):
            dpr.Renderer(SIZE, SIZE, preset="rigid", sigma=0.1)
        with self.assertRaisesRegex(dpr.InvalidArgument, "sigma .* got a value"):
            dpr.render(*MESH, *views, width=SIZE, height=SIZE, preset="rigid", sigma=np.float32([0.1]))
        for settings in ({"preset": "gaussian", "alpha": 2}, {"preset": "paper_gaussian", "samples": 4}, {"seed": 3},
                         {"preset": "rigid", "gamma": 1e-3}, {"estimator": "monte_carlo", "samples": 4}):
            dpr.Renderer(SIZE, SIZE, **settings)

    def test_misspelt_keywords(self):
        renderer, views = dpr.Renderer(SIZE, SIZE), cameras(1)
        for call, name, near in [(lambda **k: dpr.Renderer(SIZE, SIZE, **k), "super_sampling", "supersampling"),
                                 (lambda **k: renderer(*MESH, *views, **k), "face_colours", "face_colors"),
                                 (lambda **k: renderer.vjp(*MESH, *views, **k), "colour", "colors"),
                                 (lambda **k: dpr.render(*MESH, *views, width=SIZE, height=SIZE, **k), "blurr", "blur"),
                                 (lambda **k: dpr.render_with_vjp(*MESH, *views, width=SIZE, height=SIZE, **k), "presets",
                                  "preset"),
                                 (lambda **k: dpr.subdivide(*MESH, *views, width=SIZE, height=SIZE, **k), "nois",
                                  "noise")]:
            with self.assertRaisesRegex(TypeError, f"got \"{name}\", .*; did you mean '{near}'\\?"):
                call(**{name: 1})
        # A call's default would take the place of these.
        for name, value in (("wrap", "clamp"), ("filter", "nearest"), ("colors", random(4, 3))):
            with self.assertRaisesRegex(TypeError, name):
                dpr.Renderer(SIZE, SIZE, **{name: value})
        for outputs in ("depth", None):
            with self.assertRaisesRegex(TypeError, f"outputs .* got {outputs!r}, expected a list"):
                renderer(*MESH, *views, outputs=outputs)
        with self.assertRaisesRegex(TypeError, "wrt .* got 'vertices', expected a list"):
            renderer.vjp(*MESH, *views, wrt="vertices")
        with self.assertRaisesRegex(ValueError, r"opacities \(outputs, dpr.render\)"):
            renderer(*MESH, *views, outputs=["depth"], opacities=np.full(len(MESH[0]), 0.5))

    def test_sizes(self):
        for size in (16.0, np.int64(16), np.float32(16), np.array(16)):
            self.assertEqual(dpr.render(*MESH, *cameras(1), width=size, height=8).shape, (1, 8, 16, 4))
        for kind, size in ((ValueError, 16.5), (ValueError, float("nan")), (TypeError, "16"), (TypeError, (16, 16))):
            with self.assertRaisesRegex(kind, "width .*expected a whole number of pixels"):
                dpr.Renderer(size, 16)

    def test_blur_in_pixels(self):
        """The edge of a half plane has the profile of that many pixels, whatever the image's size."""
        def profile(width, height, **smoothing):
            half = [[0, -9, 0], [9, 0, 0], [0, 9, 0]]
            image = dpr.render(half, [[0, 1, 2]], dpr.look_at([0, 0, 4]), dpr.perspective(40, width, height),
                               width=width, height=height, **smoothing)
            return image[0, height // 2, :, 3]

        for width, height in ((64, 48), (40, 96)):
            for blur in (0.8, 1.5, 3.0):
                steps = np.diff(profile(width, height, blur=blur).astype(np.float64))
                places = np.arange(1, width)
                mean = (steps * places).sum() / steps.sum()
                self.assertAlmostEqual(mean, width / 2, delta=0.05)
                # A pixel's own box is part of the profile.
                variance = (steps * (places - mean) ** 2).sum() / steps.sum()
                self.assertAlmostEqual(np.sqrt(variance) / np.hypot(blur, np.sqrt(1 / 12)), 1, delta=0.08)
        for settings, sigma in (({}, (0.7 / 24) ** 2), ({"preset": "softras"}, (0.7 / 24) ** 2),
                                ({"distance": "euclidean"}, 0.7 / 24)):
            expected = profile(64, 48, sigma=sigma, **settings)
            for blur in (0.7, np.float32([0.7]), np.array(0.7)):
                np.testing.assert_allclose(profile(64, 48, blur=blur, **settings), expected, atol=1e-5)
            kept = dpr.Renderer(64, 48, blur=0.7, **settings)
            np.testing.assert_allclose(kept(*MESH, *cameras(1)), kept(*MESH, *cameras(1), sigma=sigma), atol=1e-5)
        # Of this preset, and by default, a pixel.
        for size in ((64, 48), (192, 160)):
            self.assertTrue(np.array_equal(profile(*size), profile(*size, blur=1)))
        self.assertTrue(np.array_equal(profile(192, 160, preset="softras"),
                                       profile(192, 160, preset="softras", sigma=1e-3)))
        changed = dpr.Renderer(64, 48)
        for name, value in (("sigma", 1e-3), ("preset", "softras")):
            setattr(changed, name, value)
            setattr(changed, name, None)
            np.testing.assert_array_equal(changed(*MESH, *cameras(1)), dpr.Renderer(64, 48, blur=1)(*MESH, *cameras(1)))
        np.testing.assert_array_equal(profile(64, 48, preset=None), profile(64, 48))
        with self.assertRaisesRegex(TypeError, "width.*None"):
            changed.width = None
        np.testing.assert_allclose(profile(64, 48, preset="opendr", blur=1), profile(64, 48, preset="opendr"), atol=1e-6)
        for wrong in ({"blur": 0.5, "sigma": 1e-3}, {"blur": -1}, {"blur": 0}, {"blur": float("inf")}, {"blur": "wide"},
                      {"blur": True}):
            with self.assertRaisesRegex((ValueError, TypeError), "blur"):
                profile(64, 48, **wrong)
            with self.assertRaisesRegex((ValueError, TypeError), "blur"):
                dpr.Renderer(64, 48, **wrong)

        for wrong in (np.array(-0.7), np.float32([0]), np.array(np.nan)):
            for call in (dpr.render, dpr.render_with_vjp):
                with self.assertRaisesRegex(ValueError, "blur .*got .*, expected a number of pixels above 0"):
                    call(*MESH, *cameras(1), width=64, height=48, blur=wrong)

    def test_gradient_of_blur(self):
        renderer, views, step = dpr.Renderer(SIZE, SIZE, **{**SMOOTH, "sigma": None}), cameras(1), 1e-2
        weights = random(1, SIZE, SIZE, 4, seed=3)
        for distance in ("squared", "euclidean"):
            renderer.distance = distance
            _, pullback = renderer.vjp(*MESH, *views, blur=np.array(0.6))
            found = pullback(weights)["blur"]
            sums = [(renderer(*MESH, *views, blur=0.6 + s) * weights).sum(dtype=np.float64) for s in (step, -step)]
            self.assertEqual((found.shape, found.dtype), ((), np.float64))
            self.assertAlmostEqual((sums[0] - sums[1]) / (2 * step) / found, 1, delta=0.02)

    def test_one_camera_and_many_shapes(self):
        renderer, (views, intrinsics) = dpr.Renderer(SIZE, SIZE, **SMOOTH), cameras(2)
        shapes = np.stack([TETRAHEDRON, 0.8 * TETRAHEDRON, 1.1 * TETRAHEDRON])
        weights = random(3, SIZE, SIZE, 4)

        def check(*arguments, repeated, **keywords):
            """The same as with as many cameras, whose gradients have a sum."""
            image, pullback = renderer.vjp(*arguments, **keywords)
            expected, pull_expected = renderer.vjp(*repeated, **keywords)
            np.testing.assert_array_equal(image, expected)
            found, of_repeated = pullback(weights[:len(image)]), pull_expected(weights[:len(image)])
            for name, given in zip(("views", "intrinsics"), arguments[2:]):
                self.assertEqual(found[name].shape, given.shape)
                self.assertGreater(np.abs(found[name]).sum(), 0)
                total = of_repeated[name].sum(0, keepdims=True) if len(given) == 1 else of_repeated[name]
                np.testing.assert_allclose(found[name], total, rtol=1e-5, atol=1e-5)
            return image

        many = np.repeat(views[:1], 3, 0), np.repeat(intrinsics[:1], 3, 0)
        check(shapes, FACES, views[:1], intrinsics[:1], repeated=(shapes, FACES, *many))
        check(TETRAHEDRON, FACES, views[:1], intrinsics[:1], repeated=(TETRAHEDRON, FACES, *many), colors=random(3, 4, 3))
        check(TETRAHEDRON, FACES, views[:1], intrinsics[:1], repeated=(TETRAHEDRON, FACES, *many),
              lights={"ambient": random(3, 3)})
        check(list(shapes), [FACES] * 3, views[:1], intrinsics[:1], repeated=(shapes, FACES, *many))
        check(list(shapes), FACES, views[:1], intrinsics[:1], repeated=(shapes, FACES, *many))
        check(TETRAHEDRON, FACES, views, intrinsics[:1],
              repeated=(TETRAHEDRON, FACES, views, np.repeat(intrinsics[:1], 2, 0)))
        check(TETRAHEDRON, FACES, views[:1], intrinsics,
              repeated=(TETRAHEDRON, FACES, np.repeat(views[:1], 2, 0), intrinsics))
        for one in (([TETRAHEDRON], [FACES]), (TETRAHEDRON[None], FACES[None])):
            image = check(*one, views, intrinsics, repeated=(TETRAHEDRON, FACES, views, intrinsics))
            _, pullback = renderer.vjp(*one, views, intrinsics)
            alone = renderer.vjp(TETRAHEDRON, FACES, views, intrinsics)[1](image)["vertices"]
            (gradient,) = pullback(image)["vertices"]
            np.testing.assert_allclose(gradient, alone, rtol=1e-4, atol=1e-5)
        with self.assertRaisesRegex(ValueError, r"vertices .* got \[3, 4, 3\], expected 1 or 2"):
            renderer(shapes, FACES, views, intrinsics)

    def test_a_mesh_without_faces_shows_the_background(self):
        views, intrinsics = cameras(3)
        renderer, background = dpr.Renderer(SIZE, SIZE, **SMOOTH), np.float32([0.2, 0.4, 0.6])
        meshes = [TETRAHEDRON, SQUARE[:0], SQUARE], [FACES, FACES[:0], SQUARE_FACES]
        arguments = {"background": background, "colors": [random(4, 3), random(0, 3), random(5, 3)],
                     "lights": {"ambient": random(3)}, "outputs": ["face_id", "depth"]}
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            (image, outputs), pullback = renderer.vjp(*meshes, views, intrinsics, **arguments)
        found = pullback(np.ones_like(image))
        for i in (0, 2):
            own = {**arguments, "colors": arguments["colors"][i]}
            (alone, _), pull_alone = renderer.vjp(meshes[0][i], meshes[1][i], views[i:i + 1], intrinsics[i:i + 1], **own)
            np.testing.assert_array_equal(image[i:i + 1], alone)
            np.testing.assert_array_equal(found["vertices"][i], pull_alone(np.ones_like(alone))["vertices"])
        np.testing.assert_allclose(image[1], np.broadcast_to([*background, 0], (SIZE, SIZE, 4)), rtol=1e-6)
        self.assertTrue((outputs["face_id"][1] == -1).all() and (outputs["depth"][1] == 0).all())
        self.assertEqual(found["vertices"][1].shape, (0, 3))
        nothing, pullback = renderer.vjp(SQUARE, FACES[:0], views, intrinsics, background=background)
        self.assertEqual(nothing[..., 3].max(), 0)
        gradients = pullback(np.ones_like(nothing))
        np.testing.assert_allclose(gradients["background"], 3 * SIZE * SIZE)
        self.assertEqual(np.abs(gradients["vertices"]).max(), 0)
        padded = np.stack([FACES, np.full_like(FACES, -1)])
        of_padded = renderer(np.stack([TETRAHEDRON] * 2), padded, views[:2], intrinsics[:2])
        self.assertEqual([of_padded[i, ..., 3].max() > 0.5 for i in range(2)], [True, False])

    def test_a_camera_without_a_first_dimension(self):
        (view,), (lens,) = cameras(1)
        renderer = dpr.Renderer(SIZE, SIZE, **SMOOTH)
        expected, pull_expected = renderer.vjp(TETRAHEDRON, FACES, view[None], lens[None])
        image, pullback = renderer.vjp(TETRAHEDRON, FACES, view, lens)
        np.testing.assert_array_equal(image, expected)
        found = pullback(image)
        for name, gradient in pull_expected(image).items():
            np.testing.assert_array_equal(found[name], gradient[0] if name in ("views", "intrinsics") else gradient)
        shapes = np.stack([TETRAHEDRON, 0.9 * TETRAHEDRON])
        np.testing.assert_array_equal(renderer(shapes, FACES, view, lens), renderer(shapes, FACES, view[None], lens[None]))
        tangent = random(1, 4, 4)
        np.testing.assert_array_equal(
            renderer.jvp(shapes, FACES, view, lens, tangents={"views": tangent})[1],
            renderer.jvp(shapes, FACES, view[None], lens[None], tangents={"views": tangent[None]})[1])
        self.assertEqual(renderer.subdivide(TETRAHEDRON, FACES, view, lens).faces.shape, (4, 3))
        for views, lenses in ((cameras(2)[0], lens), (view, cameras(2)[1])):
            self.assertEqual(renderer.subdivide(TETRAHEDRON, FACES, views, lenses).faces.shape, (4, 3))
        with self.assertRaisesRegex(ValueError, r"intrinsics \(dpr.subdivide\)"):
            renderer.subdivide(TETRAHEDRON, FACES, cameras(3)[0], cameras(2)[1])
        with self.assertRaisesRegex(ValueError, r"views .* got \[4\], expected \[N, 4, 4\] or \[4, 4\]"):
            renderer(TETRAHEDRON, FACES, view[0], lens)

    def test_warns_of_triangles_beyond_zfar(self):
        views, intrinsics = dpr.look_at([0, 0, 4]), dpr.perspective(40, SIZE, SIZE)
        near = np.float32([[-1, -1, 0], [1, -1, 0], [0, 1, 0]])
        both, faces = np.concatenate([near, near - [0, 0, 0.5], near - [0, 0, 9]]), np.arange(9).reshape(3, 3)

        def told(vertices, faces, zfar, count=1):
            with warnings.catch_warnings(record=True) as found:
                warnings.simplefilter("always")
                dpr.render(vertices, faces, np.repeat(views, count, 0), intrinsics, width=SIZE, height=SIZE, zfar=zfar)
            return [str(warning.message) for warning in found]

        beyond = "dpr: {} triangles lie beyond zfar ({}) and were left out"
        self.assertEqual(told(both, faces, 20), [])
        self.assertEqual(told(both, faces, None), [])
        self.assertEqual(told(both, faces[:2], 5), [])  # a vertex of no face
        self.assertEqual(told(near - np.float32([[0, 0, 0], [0, 0, 0], [0, 0, 9]]), faces[:1], 5), [])  # clipped
        self.assertEqual(told(both, faces, 5), [beyond.format(1, 5)])
        self.assertEqual(told(both, faces, 4.25, 2), [beyond.format(4, 4.25)])
        self.assertEqual(told(np.stack([near, near - np.float32([0, 0, 9])]), faces[:1], 5), [beyond.format(1, 5)])
        self.assertEqual(told([near, both], [faces[:1], faces], 5), [beyond.format(1, 5)])
        self.assertRegex(told(both, faces, 3)[0], "every triangle was dropped")

    def test_errors_name_the_mesh_of_a_list(self):
        views, intrinsics = cameras(2)
        meshes = [TETRAHEDRON, SQUARE], [FACES, SQUARE_FACES + 3]
        with self.assertRaisesRegex(ValueError, "view 1"):
            dpr.render(*meshes, views, intrinsics, width=SIZE, height=SIZE)

    def test_errors_of_rasterize_name_it(self):
        views, intrinsics = cameras(2)
        given = {"vertices": TETRAHEDRON, "faces": FACES, "views": views, "intrinsics": intrinsics}
        cases = [({"vertices": TETRAHEDRON.astype(int)}, "vertices"), ({"faces": FACES.astype(float)}, "faces"),
                 ({"faces": FACES[:, :2]}, "faces"), ({"views": views[0, 0]}, "views"),
                 ({"intrinsics": intrinsics[:, :3]}, "intrinsics"), ({"vertices": np.stack([TETRAHEDRON] * 3)}, "vertices"),
                 ({"vertices": [TETRAHEDRON], "faces": [FACES, FACES]}, "vertices"), ({"layers": 0}, "layers"),
                 ({"faces": np.stack([FACES, np.where(FACES == 0, -1, FACES)])}, "faces"), ({"layer": 2}, "name")]
        of_settings = [({"preset": "gaussian"}, "preset|noise"), ({"width": 16.5}, "width"), ({"blurr": 1}, "name"),
                       ({"blur": -1}, "blur")]
        renderer = dpr.Renderer(SIZE, SIZE)
        calls = [(renderer.rasterize, wrong, name) for wrong, name in cases]
        calls += [(lambda **given: dpr.rasterize(**{"width": SIZE, "height": SIZE, **given}), *case)
                  for case in cases + of_settings]
        for call, wrong, name in calls:
            with self.subTest(wrong), self.assertRaisesRegex((TypeError, ValueError), rf"{name}.* \(dpr.rasterize\): got"):
                call(**{**given, **wrong})
        with self.assertRaisesRegex(ValueError, r"views \(dpr.render\)"):
            renderer(TETRAHEDRON, FACES, views[0, 0], intrinsics)
        with self.assertWarns(UserWarning) as told:
            renderer.rasterize(TETRAHEDRON + np.float32([0, 0, 99]), FACES, views, intrinsics)
        self.assertEqual(told.filename, __file__)

    def test_other_types_are_converted(self):
        views, intrinsics = cameras(1)
        given = {"vertices": TETRAHEDRON, "views": views, "intrinsics": intrinsics, "colors": random(4, 3),
                 "background": np.float32([0.25, 0.5, 0.75])}
        renderer = dpr.Renderer(SIZE, SIZE, **SMOOTH)
        expected, pull_expected = renderer.vjp(faces=FACES, **given)
        gradients = pull_expected(expected)
        faces = [FACES.astype(name) for name in ("uint8", "int16", "uint32", "uint64", ">i4")] + [FACES.tolist()]
        for name, tolerance in (("float64", 1e-5), (">f4", 1e-5), ("float16", 2e-2)):
            converted = {key: array.astype(name) for key, array in given.items()}
            image, pullback = renderer.vjp(faces=faces.pop(), **converted)
            np.testing.assert_allclose(image, expected, atol=tolerance)
            for key, gradient in pullback(image.astype(np.float64)).items():
                self.assertEqual(gradient.dtype.newbyteorder("="), np.dtype(name).newbyteorder("="))
                scale = np.abs(gradients[key]).max()
                np.testing.assert_allclose(gradient / scale, gradients[key] / scale, atol=10 * tolerance)
        for indices in faces:
            np.testing.assert_array_equal(renderer(faces=indices, **given), expected)
        listed = {key: array.tolist() for key, array in given.items()}
        image, pullback = renderer.vjp(faces=FACES.tolist(), **listed)
        np.testing.assert_array_equal(image, expected)
        np.testing.assert_array_equal(pullback(image)["colors"], gradients["colors"])
        ragged = [TETRAHEDRON.tolist(), SQUARE.tolist()], [FACES.tolist(), SQUARE_FACES.tolist()]
        np.testing.assert_array_equal(renderer(*ragged, views, intrinsics),
                                      renderer([TETRAHEDRON, SQUARE], [FACES, SQUARE_FACES], views, intrinsics))
        lights = {"ambient": [0.25, 0.5, 1], "point": [[2, 2, 4, 1, 1, 1, 0, 0, 0]]}
        lit = renderer(*MESH, views, intrinsics, lights=lights, texcoords=[[0, 0], [1, 0], [0, 1], [1, 1]],
                       textures=[[[1, 0, 0], [0, 1, 0]]])
        self.assertGreater(lit[..., :3].max(), 0.2)
        wall, lens = [[-2, -1.6, 2], [2, -1.5, 1.8], [2, 1.6, 1.7]], [[45, 45, 40, 30, -0.22, 0.03, 0, 0, 0]]
        cut = dpr.subdivide(wall, [[0, 1, 2]], views, lens, width=80, height=60, texcoords=[[0, 0], [1, 0], [1, 1]])
        self.assertEqual(cut.texcoords.shape, (len(cut.faces), 3, 2))

    def test_signatures(self):
        settings, of_call = {"preset", "blur", "supersampling", "znear", "cull"}, {"colors", "lights", "outputs", "copy"}
        for function, names in [(dpr.Renderer, {"width", "height", "device", "sigma", *settings}),
                                (dpr.Renderer.__call__, {"vertices", "sigma", "blur", *of_call}),
                                (dpr.Renderer.vjp, {"vertices", "wrt", *of_call}),
                                (dpr.render, {"vertices", "width", *settings, *of_call}),
                                (dpr.render_with_vjp, {"faces", "wrt", *settings, *of_call}),
                                (dpr.subdivide, {"tolerance", "device", *settings})]:
            parameters = inspect.signature(function).parameters
            self.assertLessEqual(names, set(parameters))
            self.assertNotIn(inspect.Parameter.VAR_KEYWORD, {parameter.kind for parameter in parameters.values()})
        for parameter in inspect.signature(dpr.Renderer).parameters.values():
            if parameter.default not in (inspect.Parameter.empty, None):
                dpr.Renderer(SIZE, SIZE, **{parameter.name: parameter.default})
        self.assertRegex(dpr.__version__, r"^\d+\.\d+\.\d+$")

    def test_interrupt_ends_a_call_after_the_mesh(self):
        count, (views, intrinsics) = 4000, cameras(1)
        meshes = [TETRAHEDRON] * count, [FACES] * count
        timer = threading.Timer(0.5, _thread.interrupt_main)
        timer.start()
        with self.assertRaises(KeyboardInterrupt):
            dpr.render(*meshes, views, intrinsics, width=256, height=256)
        timer.join()
        dpr.render(*MESH, views, intrinsics, width=SIZE, height=SIZE)


if __name__ == "__main__":
    unittest.main(verbosity=2)
