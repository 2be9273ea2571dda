"""The Python package `dpr` with NumPy alone, and with arrays that have nothing but DLPack."""
import ctypes
import os
import pathlib
import pickle
import shutil
import subprocess
import sys
import tempfile
import threading
import unittest
import warnings

try:
    import numpy as np
except ImportError:
    print("skipped: no python3-numpy")
    sys.exit(0)

import dpr
from scenes import (FACES, SIZE, SMOOTH, SQUARE, SQUARE_FACES, TETRAHEDRON, cameras, random, textured)


class OfDlpack:
    """An array of a library that nobody knows."""

    def __init__(self, array):
        self._array = array
        self.dtype, self.shape = array.dtype, array.shape

    def __dlpack__(self, **arguments):
        return self._array.__dlpack__(**arguments)

    def __dlpack_device__(self):
        return self._array.__dlpack_device__()


def run(code, **environment):
    """Output and status of a Python that has the package."""
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=300,
                            env={**os.environ, **environment})
    return result.returncode, result.stdout + result.stderr


class NumpyTest(unittest.TestCase):
    def check_gradient(self, name, change, wrt, arguments, settings=SMOOTH, tolerance=2e-3):
        """Compares a sum of pixels' gradient along a direction with its difference. `change(arguments, step)` moves the arrays and
        gives the direction's scalar product with a gradient."""
        renderer = dpr.Renderer(SIZE, SIZE, **settings)
        weights = random(2, SIZE, SIZE, 4, seed=3) - 0.5
        image, pullback = renderer.vjp(**arguments, wrt=[wrt])
        along = change(arguments, 0.0)[1](pullback(weights)[wrt])
        step = 1e-3
        sums = [(renderer(**change(arguments, s)[0]).astype(np.float64) * weights).sum() for s in (step, -step)]
        with self.subTest(name):
            self.assertAlmostEqual((sums[0] - sums[1]) / (2 * step) / along, 1, delta=tolerance + 5e-2)

    def test_gradients(self):
        views, intrinsics = cameras(2)
        arguments = {"vertices": SQUARE, "faces": SQUARE_FACES, "views": views, "intrinsics": intrinsics, **textured()}

        def of_array(name, direction):
            def change(given, step):
                return {**given, name: given[name] + np.float32(step) * direction}, lambda g: (g * direction).sum()
            return change

        def of_entry(name, key):
            direction = random(*arguments[name][key].shape, seed=8) - 0.5

            def change(given, step):
                inner = dict(given[name]) if isinstance(given[name], dict) else list(given[name])
                inner[key] = inner[key] + np.float32(step) * direction
                return {**given, name: inner}, lambda g: (g[key] * direction).sum()
            return change

        for name in ("vertices", "intrinsics"):
            self.check_gradient(name, of_array(name, random(*arguments[name].shape, seed=7) - 0.5), name, arguments)
        for name, key in (("lights", "ambient"), ("lights", "point"), ("textures", 0), ("textures", 1),
                          ("materials", "specular"), ("materials", "shininess")):
            self.check_gradient(f"{name}.{key}", of_entry(name, key), name, arguments)

    def test_opacities(self):
        views, intrinsics = cameras(2)
        for name, count in (("opacities", len(SQUARE)), ("face_opacities", len(SQUARE_FACES))):
            arguments = {"vertices": SQUARE, "faces": SQUARE_FACES, "views": views, "intrinsics": intrinsics,
                         name: random(count, seed=4) * np.float32(0.8) + np.float32(0.1)}
            direction = random(count, seed=7) - 0.5
            self.check_gradient(name, lambda given, step, name=name, direction=direction: (
                {**given, name: given[name] + np.float32(step) * direction}, lambda g: (g * direction).sum()), name,
                arguments)
            renderer = dpr.Renderer(SIZE, SIZE, **SMOOTH)
            image, tangents = renderer.jvp(**arguments, tangents={name: direction[None]})
            weights = random(*image.shape, seed=3)
            gradient = renderer.vjp(**arguments, wrt=[name])[1](weights)[name]
            self.assertAlmostEqual((tangents[0] * weights).sum() / (gradient * direction).sum(), 1, delta=1e-4)
            opaque = {**arguments, name: np.ones(count, np.float32)}
            np.testing.assert_array_equal(renderer(**opaque), renderer(**{**opaque, name: None}))
            np.testing.assert_array_equal(dpr.render(**opaque, width=SIZE, height=SIZE, preset="pixel"),
                                          dpr.render(**{**opaque, name: None}, width=SIZE, height=SIZE, preset="pixel"))
            half = {**arguments, name: np.full(count, 0.5, np.float32)}
            np.testing.assert_allclose(renderer(**half)[..., 3], renderer(**opaque)[..., 3] / 2, atol=0.3)
            of_pixel, rigid = (dpr.render(**half, width=SIZE, height=SIZE, preset=preset) for preset in ("pixel", "rigid"))
            self.assertAlmostEqual(of_pixel[..., 3].mean() / rigid[..., 3].mean(), 1, delta=0.05)
            with self.assertRaisesRegex(ValueError, "opacities"):
                dpr.render(**arguments, width=SIZE, height=SIZE, outputs=["depth"], **SMOOTH)
            with self.assertRaisesRegex(ValueError, name):
                renderer(**{**arguments, name: np.full(count + 1, 0.5, np.float32)})
            with self.assertRaisesRegex(ValueError, "opacities.*expected a number from 0 to 1"):
                renderer(**{**arguments, name: np.full(count, 1.5, np.float32)})

    def test_opacities_of_texels(self):
        views, intrinsics = cameras(2)
        arguments = {"views": views, "intrinsics": intrinsics, "vertices": SQUARE, "faces": SQUARE_FACES,
                     "texcoords": random(len(SQUARE), 2, seed=6)}
        leaf = random(5, 7, 4, seed=4) * np.float32(0.8) + np.float32(0.1)
        direction = random(5, 7, 4, seed=7) - 0.5
        self.check_gradient("textures", lambda given, step: (
            {**given, "textures": given["textures"] + np.float32(step) * direction}, lambda g: (g * direction).sum()),
            "textures", {**arguments, "textures": leaf})
        renderer = dpr.Renderer(SIZE, SIZE, **SMOOTH)
        opaque = np.concatenate([leaf[..., :3], np.ones((5, 7, 1), np.float32)], 2)
        plain = renderer(**arguments, textures=leaf[..., :3].copy())
        np.testing.assert_array_equal(renderer(**arguments, textures=opaque), plain)
        self.assertGreater(np.abs(renderer(**arguments, textures=leaf) - plain).max(), 0.1)
        mixed = [leaf[..., :3].copy(), leaf]
        faces = {"face_textures": np.arange(len(SQUARE_FACES)) % 2}
        gradient = renderer.vjp(**arguments, **faces, textures=mixed, wrt=["textures"])[1](plain)["textures"]
        self.assertEqual([texture.shape for texture in gradient], [(5, 7, 3), (5, 7, 4)])
        self.assertGreater(np.abs(gradient[1][..., 3]).max(), 0)
        with self.assertRaisesRegex(ValueError, "textures, alpha of texel .*expected a number from 0 to 1"):
            renderer(**arguments, textures=2 * leaf)

    def test_gradients_through_a_fisheye(self):
        views, intrinsics = cameras(2)
        rows = np.concatenate([intrinsics, np.tile(np.float32([0.3, -0.2, 0.1, -0.05]), (2, 1))], 1)
        arguments = {"vertices": 3 * SQUARE, "faces": SQUARE_FACES, "views": views, "intrinsics": rows}
        self.assertGreater(np.abs(dpr.render(**arguments, width=SIZE, height=SIZE)
                                  - dpr.render(**{**arguments, "intrinsics": intrinsics}, width=SIZE, height=SIZE)).max(),
                           0.1)
        directions = {"vertices": random(*SQUARE.shape, seed=7) - 0.5,
                      "intrinsics": np.float32([[0] * 4 + [1, 1, 2, 3]] * 2)}
        for name, direction in directions.items():
            self.check_gradient(name, lambda given, step, name=name, direction=direction: (
                {**given, name: given[name] + np.float32(step) * direction}, lambda g: (g * direction).sum()), name,
                arguments)

    def test_gradients_have_the_arguments_form(self):
        views, intrinsics = cameras(2)
        arguments = textured()
        (image, outputs), pullback = dpr.render_with_vjp(SQUARE, SQUARE_FACES, views, intrinsics, width=SIZE, height=SIZE,
                                                         outputs=["depth", "face_id"], sigma=np.float32([2e-3]), **arguments)
        found = pullback(np.ones_like(image), depth=np.ones_like(outputs["depth"]))
        self.assertEqual(set(found), {"vertices", "views", "intrinsics", "texcoords", "textures", "materials", "lights",
                                      "sigma"})
        self.assertEqual([texture.shape for texture in found["textures"]], [(5, 7, 3), (4, 2, 3)])
        self.assertEqual(found["lights"]["point"].shape, (1, 9))
        self.assertEqual(found["materials"]["shininess"].shape, (2,))
        for gradient in (found["vertices"], found["sigma"], *found["textures"], *found["lights"].values()):
            self.assertGreater(np.abs(gradient).sum(), 0)
        again = pullback(np.ones_like(image), depth=np.ones_like(outputs["depth"]))
        np.testing.assert_array_equal(again["vertices"], found["vertices"])
        for wrong in ({"image": image[0]}, {"face_id": image[..., 0]}, {"colour": image}):
            with self.assertRaisesRegex(ValueError, "gradient"):
                pullback(**wrong)
        for wrong in ((image, outputs), 1.0, "image"):  # the first as JAX has it
            with self.assertRaisesRegex(TypeError, "gradient of image .* expected an array; those of outputs by their names"):
                pullback(wrong)
        np.testing.assert_array_equal(pullback(np.ones_like(image).tolist())["vertices"],
                                      pullback(np.ones_like(image))["vertices"])
        for name in ("colors", "faces"):
            with self.assertRaisesRegex(ValueError, f"wrt .* got '{name}', expected names of given arrays"):
                dpr.render_with_vjp(SQUARE, SQUARE_FACES, views, intrinsics, width=SIZE, height=SIZE, wrt=[name])

    def test_lists_and_views_of_their_own(self):
        views, intrinsics = cameras(2)
        renderer = dpr.Renderer(SIZE, SIZE, **SMOOTH)
        image, pullback = renderer.vjp([TETRAHEDRON, SQUARE], [FACES, SQUARE_FACES], views, intrinsics,
                                       lights={"ambient": random(2, 3)})
        found = pullback(image)
        self.assertEqual([gradient.shape for gradient in found["vertices"]], [(4, 3), (5, 3)])
        self.assertEqual(found["lights"]["ambient"].shape, (2, 3))
        for i, (vertices, faces) in enumerate([(TETRAHEDRON, FACES), (SQUARE, SQUARE_FACES)]):
            alone, pull_alone = renderer.vjp(vertices, faces, views[i:i + 1], intrinsics[i:i + 1],
                                             lights={"ambient": random(2, 3)[i]})
            np.testing.assert_array_equal(image[i:i + 1], alone)
            np.testing.assert_array_equal(found["vertices"][i], pull_alone(alone)["vertices"])
        shared = {"ambient": random(2, 3)}
        image, pullback = renderer.vjp(SQUARE, SQUARE_FACES, views, intrinsics, lights=shared, wrt=["vertices"])
        parts = []
        for i in range(2):
            alone, pull_alone = renderer.vjp(SQUARE, SQUARE_FACES, views[i:i + 1], intrinsics[i:i + 1],
                                             lights={"ambient": shared["ambient"][i]}, wrt=["vertices"])
            parts.append(pull_alone(image[i:i + 1])["vertices"])
        np.testing.assert_allclose(pullback(image)["vertices"], sum(parts), rtol=1e-5, atol=1e-6)

    def test_any_array_with_dlpack(self):
        views, intrinsics = cameras(1)
        given = (TETRAHEDRON, FACES, views, intrinsics)
        expected, pull_expected = dpr.render_with_vjp(*given, width=SIZE, height=SIZE)
        image, pullback = dpr.render_with_vjp(*map(OfDlpack, given), width=SIZE, height=SIZE)
        np.testing.assert_array_equal(image, expected)
        np.testing.assert_array_equal(pullback(OfDlpack(image))["vertices"], pull_expected(expected)["vertices"])
        strided = [np.asfortranarray(array) for array in given]
        np.testing.assert_array_equal(dpr.render(*strided, width=SIZE, height=SIZE), expected)

    def test_wrong_arguments(self):
        views, intrinsics = cameras(1)
        good = {"vertices": TETRAHEDRON, "faces": FACES, "views": views, "intrinsics": intrinsics, "width": SIZE,
                "height": SIZE}
        expected = dpr.render(**good)
        for kind, words, change in [
                (TypeError, "vertices .* got int64, expected float32", {"vertices": TETRAHEDRON.astype(int)}),
                (TypeError, "vertices .* got list, expected a tensor or an array", {"vertices": [["a", "b", "c"]]}),
                (TypeError, "faces .* got NoneType", {"faces": None}),
                (TypeError, "faces .* got float64, expected int64", {"faces": FACES.astype(float).tolist()}),
                (TypeError, "faces .* got bool, expected int64", {"faces": FACES.astype(bool)}),
                (dpr.InvalidArgument, r"views .* got \[1, 3, 4\], expected \[N, 4, 4\]", {"views": views[:, :3]}),
                (dpr.InvalidArgument, "finite", {"vertices": TETRAHEDRON / np.float32(np.inf) * np.float32(np.inf)}),
                (ValueError, "lights .* got 'a|b', expected names", {"lights": {"a|b": random(3)}}),
                (ValueError, "wrap", {"textures": random(2, 2, 3), "texcoords": random(4, 2), "wrap": "a|b"}),
                (ValueError, "did you mean 'zfar'", {"zfr": 3}),
                (TypeError, "did you mean 'texcoords'", {"texcoord": random(4, 2)}),
                (ValueError, "no-such-device", {"device": "no-such-device"})]:
            with self.subTest(words), warnings.catch_warnings():
                warnings.simplefilter("ignore")
                with self.assertRaisesRegex(kind, words):
                    dpr.render(**{**good, **change})
        np.testing.assert_array_equal(dpr.render(**good), expected)
        with self.assertRaisesRegex(TypeError, "did you mean 'background'"):
            dpr.Renderer(SIZE, SIZE)(TETRAHEDRON, FACES, views, intrinsics, backgrund=random(3))

    def test_subdivision(self):
        wall = np.array([[-2.0, -1.6, 2.0], [2.1, -1.5, 1.8], [2.0, 1.6, 1.7], [-2.2, 1.5, 2.1]], np.float32)
        lens = np.array([[45.0, 45.0, 40.0, 30.0, -0.22, 0.03, 0.0, 0.0, 0.0]], np.float32)
        cut = dpr.subdivide(wall, np.array([[0, 1, 2], [0, 2, 3]]), cameras(1)[0], lens, width=80, height=60,
                            texcoords=wall[:, :2])
        self.assertGreater(len(cut.faces), 20)
        fisheye = dpr.subdivide(wall, np.array([[0, 1, 2], [0, 2, 3]]), cameras(1)[0], lens[:, :8], width=80, height=60)
        self.assertGreater(len(fisheye.faces), 20)
        np.testing.assert_allclose(cut.texcoords, cut.of_vertices(wall)[cut.faces][..., :2], atol=1e-6)

    def test_threads_and_pickles(self):
        renderer, arguments = dpr.Renderer(SIZE, SIZE, **SMOOTH), (TETRAHEDRON, FACES, *cameras(1))
        expected, found = renderer(*arguments), []
        threads = [threading.Thread(target=lambda: found.extend(renderer(*arguments) for _ in range(8)))
                   for _ in range(3)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        self.assertEqual(len(found), 24)
        for image in [*found, pickle.loads(pickle.dumps(renderer))(*arguments)]:
            np.testing.assert_array_equal(image, expected)
        dpr.release()
        with self.assertWarnsRegex(UserWarning, "every triangle was dropped"):
            dpr.render(*arguments, width=SIZE, height=SIZE, znear=50, zfar=60)

    def test_imports_no_other_library(self):
        status, said = run("import dpr, sys; print(dpr.__version__, sorted({'torch', 'jax'} & set(sys.modules)))")
        self.assertEqual((status, said), (0, f"{dpr.__version__} []\n"))

    def test_import_tells_what_is_missing(self):
        status, said = run("import dpr", DPR_LIBRARY="/no/such/libdpr.so")
        self.assertEqual(status, 1)
        self.assertIn("dpr: error: libdpr (import dpr): got /no/such/libdpr.so: cannot open", said.splitlines()[-1])
        hide = "import pathlib; pathlib.Path.glob = lambda *_: iter(())\nimport dpr"
        status, said = run(hide, OCL_ICD_VENDORS="", OCL_ICD_FILENAMES="", OPENCL_VENDOR_PATH="")
        self.assertEqual(status, 0)
        self.assertIn("UserWarning: dpr: no OpenCL driver in /etc/OpenCL/vendors", said)
        self.assertIn("apt install ocl-icd-libopencl1 pocl-opencl-icd", said)

    def test_a_driver_in_a_package_is_activated_first(self):
        with tempfile.TemporaryDirectory() as folder:
            driver = pathlib.Path(folder) / "dpr_pocl.py"
            driver.write_text("import sys\ndef activate():\n    print('activated', 'dpr._renderer' in sys.modules)\n")
            path = folder + os.pathsep + str(pathlib.Path(dpr.__file__).parent.parent)
            self.assertEqual(run("import dpr", PYTHONPATH=path), (0, "activated False\n"))

    def test_another_library_is_refused(self):
        with tempfile.TemporaryDirectory() as folder:
            package = shutil.copytree(pathlib.Path(dpr.__file__).parent, pathlib.Path(folder) / "dpr")
            (package / "_version.py").write_text('VERSION = "9.8.7"\n')
            status, said = run("import dpr", PYTHONPATH=folder, DPR_LIBRARY=dpr._library.library._name)
        self.assertEqual(status, 1)
        self.assertRegex(said.splitlines()[-1], "libdpr .* got version .* expected 9.8.7")

    def test_devices(self):
        (default,) = [device for device in dpr.devices() if device["is_default"]]
        self.assertIn(default["type"], ("cpu", "gpu", "accelerator"))
        self.assertGreater(default["compute_units"], 0)


class InterfaceTest(unittest.TestCase):
    """The C interface below, which trusts no caller."""

    def test_refuses_wrong_arrays(self):
        from dpr import _frames, _library
        views, intrinsics = cameras(1)
        arrays = {"vertices": TETRAHEDRON, "faces": FACES, "views": views, "intrinsics": intrinsics}
        spec = dpr.Renderer(SIZE, SIZE)._spec()

        def render(change=None, slots=lambda slots: None, **options):
            given = _frames.options_of(spec, gradients=["vertices"])
            for name, value in options.items():
                setattr(given, name, value)
            found, count = _frames.c_arrays(list({**arrays, **(change or {})}.items()))
            slots(found)
            handle = ctypes.c_void_p()
            _library.call("dpr_frame_render", ctypes.byref(given), found, count, ctypes.byref(handle))
            return handle

        def slot(**values):
            def change(slots):
                for name, value in values.items():
                    setattr(slots[0], name, value)
            return change

        frame = render()
        self.addCleanup(_library.library.dpr_frame_destroy, frame)

        def read(name, array):
            _library.call("dpr_frame_read", frame, *_frames.c_arrays([(name, array)]))

        def backward(grad, gradient):
            _library.call("dpr_frame_backward", frame, *_frames.c_arrays([grad]), *_frames.c_arrays([gradient]))

        image = np.ones((1, SIZE, SIZE, 4), np.float32)
        for words, refused in [
                ("size.*expected 1 to", lambda: render(size=7)),
                ("width .*got 0", lambda: render(width=0)),
                ("vertices.*got NULL", lambda: render(slots=slot(data=None))),
                ("name .*got NULL", lambda: render(slots=slot(name=None))),
                ("element .*got 7", lambda: render(slots=slot(element=7))),
                ("dimensions .*got 9", lambda: render(slots=slot(dimensions=9))),
                ("dimensions .*got -1", lambda: render(slots=slot(dimensions=-1))),
                ("vertices .*got int64, expected float32", lambda: render({"vertices": FACES})),
                ("faces .*got float32", lambda: render({"faces": TETRAHEDRON})),
                ('array .*got "vertexes"', lambda: render({"vertexes": TETRAHEDRON})),
                ('array .*got "textures\\[1\\]"', lambda: render({"textures[1]": random(2, 2, 3)})),
                (r"background .*got \[4\], expected \[3\]", lambda: render({"background": random(4)})),
                (r"image .*got \[1, 16, 16\], expected \[1, 16, 16, 4\]", lambda: read("image", image[..., 0].copy())),
                ("face_id .*got float32, expected int64", lambda: read("face_id", image[..., 0].copy())),
                ("outputs .*got 'shadow'", lambda: read("shadow", image)),
                ("views .*not asked for", lambda: backward(("image", image), ("views", views.copy()))),
                ("vertices .*got indices, expected float32", lambda: backward(("image", image), ("vertices", FACES.copy()))),
                (r"vertices .*got \[3, 3\]", lambda: backward(("image", image), ("vertices", TETRAHEDRON[:3].copy()))),
                ("face_id .*without gradients", lambda: backward(("face_id", np.zeros((1, SIZE, SIZE), np.int64)),
                                                                ("vertices", TETRAHEDRON.copy()))),
                ("no images of an attribute", lambda: backward(("depth", image), ("vertices", TETRAHEDRON.copy())))]:
            with self.subTest(words), self.assertRaisesRegex(dpr.InvalidArgument, words):
                refused()
        for name in ("dpr_frame_render", "dpr_frame_check"):
            with self.assertRaisesRegex(dpr.InvalidArgument, "got NULL"):
                _library.call(name, *([None] * len(_library._SIGNATURES[name][:1])), *((None, 0, None) if "render" in name
                                                                                      else ()))
        gradient = np.empty_like(TETRAHEDRON)
        backward(("image", image), ("vertices", gradient))
        self.assertTrue(np.isfinite(gradient).all() and np.abs(gradient).sum() > 0)


if __name__ == "__main__":
    unittest.main(verbosity=2)
