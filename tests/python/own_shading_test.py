"""Shading of the caller's own in the Python package: the library's own colours, found by the caller, make its images and
gradients."""
import os
import subprocess
import sys
import tempfile
import unittest

try:
    import numpy as np
except ImportError:
    print("skipped: no python3-numpy")
    sys.exit(0)
try:
    import torch
except ImportError:
    torch = None

import dpr
from scenes import FACES, SIZE, SQUARE, SQUARE_FACES, TETRAHEDRON, cameras, random

COLORS = random(4, 3, seed=5)
WEIGHTS = random(2, SIZE, SIZE, 4, seed=3) - 0.5
BACKGROUND = np.float32([0.1, 0.2, 0.3])
RENDERER = dpr.Renderer(SIZE, SIZE, blur=0.6, gamma=1e-7)


def shaded(samples, colors):
    """RGBA of the samples, and the mask."""
    mask = samples.mask[..., None]
    return np.concatenate([np.where(mask, samples.interpolate(colors), BACKGROUND), mask], -1).astype(np.float32)


class OwnShadingTest(unittest.TestCase):
    def setUp(self):
        self.views, self.intrinsics = cameras(2)

    def arguments(self, vertices=TETRAHEDRON):
        return vertices, FACES, self.views, self.intrinsics

    def check_close(self, found, expected, tolerance):
        found, expected = np.asarray(found), np.asarray(expected)
        self.assertEqual(found.shape, expected.shape)
        self.assertGreater(np.abs(expected).max(), 0)
        self.assertLess(np.abs(found - expected).max() / np.abs(expected).max(), tolerance)

    def test_samples(self):
        samples = RENDERER.rasterize(*self.arguments())
        size = samples.supersampling * SIZE + 2 * samples.margin
        self.assertEqual(samples.face_id.shape, (2, size, size))
        self.assertTrue(((samples.face_id == -1) == (samples.depth == 0)).all())
        self.assertLess(np.abs(samples.barycentrics.sum(-1) - samples.mask).max(), 1e-5)
        depths = -(TETRAHEDRON @ self.views[:, 2, :3].T + self.views[:, 2, 3]).T[..., None]  # [N, V, 1]
        self.assertLess(np.abs(samples.interpolate(depths)[..., 0] - samples.depth).max(), 1e-4)
        corners = samples.interpolate(COLORS[FACES].reshape(-1, 3), np.arange(12).reshape(4, 3))
        self.assertTrue((corners == samples.interpolate(COLORS)).all())

    def test_samples_are_of_what_was_rasterized(self):
        """Also where arrays change in place afterwards."""
        for of in (np.array, torch.tensor) if torch else (np.array,):
            for meshes in (of, lambda array: [of(array)]):
                vertices, faces = meshes(TETRAHEDRON), meshes(FACES)
                wanted = RENDERER.rasterize(vertices, faces, self.views, self.intrinsics)
                wanted = [wanted.interpolate(meshes(COLORS), covered=covered) for covered in (True, False)]
                samples = RENDERER.rasterize(vertices, faces, self.views, self.intrinsics)
                for array, changed in ((vertices, of(TETRAHEDRON)[[3, 1, 2, 0]]), (faces, of(FACES)[[1, 0, 3, 2]])):
                    (array[0] if isinstance(array, list) else array)[:] = changed
                for covered, values in zip((True, False), wanted):
                    np.testing.assert_array_equal(samples.interpolate(meshes(COLORS), covered=covered), values)

    def test_images_and_gradients_are_the_librarys(self):
        for vertices in (TETRAHEDRON, np.stack([TETRAHEDRON, 0.8 * TETRAHEDRON])):
            arguments = {"colors": COLORS, "background": BACKGROUND, "wrt": ["vertices", "views", "intrinsics"]}
            image, pullback = RENDERER.vjp(*self.arguments(vertices), **arguments)
            wanted = pullback(WEIGHTS)
            samples = RENDERER.rasterize(*self.arguments(vertices))
            found, own_pullback = samples.resolve_with_vjp(shaded(samples, COLORS))
            self.check_close(found, image, 1e-5)
            grad_values, by_contours = own_pullback(WEIGHTS)
            for wrong in ((WEIGHTS,), None):
                with self.assertRaisesRegex(TypeError, "gradient of the images .*an array"):
                    own_pullback(wrong)
            with self.assertRaisesRegex(TypeError, "barycentrics .*an array"):
                samples.pullback(barycentrics="wrong")
            corners = COLORS[FACES[samples.face_id.clip(0)]]
            grad_barycentrics = (corners * grad_values[..., None, :3]).sum(-1) * samples.mask[..., None]
            inside = samples.pullback(barycentrics=grad_barycentrics)
            for name, gradient in wanted.items():
                with self.subTest(name):
                    self.check_close(by_contours[name] + inside[name], gradient, 1e-4)

    def test_parts(self):
        """Colours of faces make the library's images and gradients where each face is a part, of meshes of every kind."""
        square = np.concatenate([0.9 * SQUARE[:3], SQUARE[:1]])
        padded = np.stack([FACES, np.concatenate([FACES[:1], -np.ones((3, 3), np.int64)])])
        apart, turned = np.arange(4)[::-1], TETRAHEDRON * np.float32([1, -1, -1])
        for name, vertices, faces, parts in (
                ("shared", turned, FACES, apart), ("shapes", np.stack([turned, 0.8 * turned]), FACES, list(apart)),
                ("padded", np.stack([turned, square]), padded, np.stack([apart, apart])),
                ("list", [turned, SQUARE], [FACES, SQUARE_FACES], [apart, np.arange(len(SQUARE_FACES))])):
            with self.subTest(name):
                is_list = isinstance(faces, list)
                colors = [random(len(own), 3, seed=len(own)) for own in faces] if is_list else random(*faces.shape[:-1], 3, seed=4)
                shown = colors if is_list or faces.ndim == 3 else colors[None]
                image, pullback = RENDERER.vjp(vertices, faces, self.views, self.intrinsics, face_colors=colors, wrt=["vertices"])
                samples = RENDERER.rasterize(vertices, faces, self.views, self.intrinsics, parts=parts)
                ids = samples.face_id.clip(0)
                values = np.stack([shown[view % len(shown)][own] for view, own in enumerate(ids)])
                values = np.concatenate([values, np.ones_like(values[..., :1])], -1) * samples.mask[..., None]
                found, own_pullback = samples.resolve_with_vjp(values)
                self.check_close(found, image, 1e-5)
                _, gradient = own_pullback(WEIGHTS)
                self.assertEqual(sorted(gradient), ["intrinsics", "vertices", "views"])
                wanted = pullback(WEIGHTS)["vertices"]
                for ours, theirs in zip(gradient["vertices"] if is_list else [gradient["vertices"]], wanted if is_list else [wanted]):
                    self.check_close(ours, theirs, 1e-4)
                without = RENDERER.rasterize(vertices, faces, self.views, self.intrinsics).resolve(values)
                self.assertGreater(np.abs(without - image).max(), 0.02)
        if torch:  # a body that turns, by the library's own image and by tensors
            colors, gradients = torch.from_numpy(random(4, 3, seed=4)), []
            for is_own in (False, True):
                vertices = torch.from_numpy(turned.copy()).requires_grad_()
                given = vertices, torch.from_numpy(FACES), self.views, self.intrinsics
                samples = RENDERER.rasterize(*given, parts=torch.arange(4)) if is_own else None
                image = samples.resolve(colors[samples.face_id.clamp(min=0)] * samples.mask[..., None]) if is_own else \
                    RENDERER(*given, face_colors=colors)[..., :3]
                gradients.append(torch.autograd.grad((image * torch.from_numpy(WEIGHTS[..., :3].copy())).sum(), vertices)[0])
            self.check_close(*gradients, 1e-4)
        ones, none = (RENDERER.rasterize(turned, FACES, self.views, self.intrinsics, parts=parts).resolve(values)
                      for parts in (np.ones(4, np.int64), None))
        np.testing.assert_array_equal(ones, none)
        for given, error, words in (([apart, apart], TypeError, "parts .*got list"), (apart[1:], ValueError, r"parts .*\[3\], expected \[4\]"),
                                    (np.zeros(4), TypeError, "parts .*indices"), ("wrong", TypeError, "parts .*str")):
            with self.subTest(words), self.assertRaisesRegex(error, words):
                RENDERER.rasterize(*self.arguments(), parts=given)

    @unittest.skipUnless(torch, "no PyTorch")
    def test_pytorch(self):
        tensors = [torch.from_numpy(array).requires_grad_() for array in (TETRAHEDRON.copy(), self.views, self.intrinsics)]
        colors = torch.from_numpy(COLORS.copy()).requires_grad_()
        vertices, views, intrinsics = tensors
        faces, weights = torch.from_numpy(FACES), torch.from_numpy(WEIGHTS)
        image = RENDERER(vertices, faces, views, intrinsics, colors=colors)
        (image * weights).sum().backward()
        wanted = [tensor.grad for tensor in (*tensors, colors)]
        for tensor in (*tensors, colors):
            tensor.grad = None
        samples = RENDERER.rasterize(vertices, faces, views, intrinsics)
        values = torch.cat([samples.interpolate(colors), samples.mask[..., None].float()], -1)
        found = samples.resolve(values)
        (found * weights).sum().backward()
        self.check_close(found.detach(), image.detach(), 1e-5)
        for tensor, gradient in zip((*tensors, colors), wanted):
            self.check_close(tensor.grad, gradient, 1e-4)

    @unittest.skipUnless(torch, "no PyTorch")
    def test_gradients_of_depths(self):
        vertices = torch.from_numpy(TETRAHEDRON.copy()).requires_grad_()
        views, intrinsics = map(torch.from_numpy, cameras(2))
        faces = torch.from_numpy(FACES)
        samples = RENDERER.rasterize(vertices, faces, views, intrinsics)
        samples.depth.sum().backward()
        # The same by barycentrics: depths are interpolated with perspective.
        found, vertices.grad = vertices.grad, None
        samples = RENDERER.rasterize(vertices, faces, views, intrinsics)
        depths = -(vertices @ views[:, 2, :3, None] + views[:, None, 2, 3:])
        samples.interpolate(depths).sum().backward()
        self.check_close(found, vertices.grad, 1e-3)

    def test_padded_meshes(self):
        """A tetrahedron and one of its faces."""
        padding = np.float32([[99, 99, 99]])
        vertices = np.stack([TETRAHEDRON, np.concatenate([0.9 * TETRAHEDRON[:3], padding])])
        faces = np.stack([FACES, np.concatenate([FACES[:1], -np.ones((3, 3), np.int64)])])
        colors = random(2, 4, 3, seed=8)
        samples = RENDERER.rasterize(vertices, faces, self.views, self.intrinsics)
        image, resolved = samples.resolve_with_vjp(shaded(samples, colors))
        grad_values, by_contours = resolved(WEIGHTS)
        corners = colors[np.arange(2)[:, None, None, None], faces[np.arange(2)[:, None, None], samples.face_id.clip(0)]]
        inside = samples.pullback((corners * grad_values[..., None, :3]).sum(-1) * samples.mask[..., None])
        if torch:
            leaf = torch.from_numpy(vertices).requires_grad_()
            tensors = RENDERER.rasterize(leaf, torch.from_numpy(faces), self.views, self.intrinsics)
            mask = tensors.mask[..., None]
            values = torch.where(mask, tensors.interpolate(colors), torch.from_numpy(BACKGROUND))
            found = tensors.resolve(torch.cat([values, mask.float()], -1))
            self.check_close(found.detach(), image, 1e-6)
            (found * torch.from_numpy(WEIGHTS)).sum().backward()
        for i, count in enumerate((4, 1)):
            arguments = vertices[i, :4 - i], faces[i, :count], self.views[i:i + 1], self.intrinsics[i:i + 1]
            expected, pullback = RENDERER.vjp(*arguments, colors=colors[i, :4 - i], background=BACKGROUND, wrt=["vertices"])
            self.check_close(image[i:i + 1], expected, 1e-5)
            wanted = pullback(WEIGHTS[i:i + 1])["vertices"]
            self.check_close((by_contours["vertices"] + inside["vertices"])[i, :4 - i], wanted, 1e-4)
            if torch:
                self.check_close(leaf.grad[i, :4 - i], wanted, 1e-4)
        self.assertTrue((by_contours["vertices"][1, 3] == 0).all())
        with self.assertRaisesRegex(ValueError, "vertices"):
            RENDERER.rasterize(vertices[[0, 0, 1]], faces, self.views, self.intrinsics)
        nothing = RENDERER.rasterize(np.zeros((0, 3)), np.zeros((0, 3), np.int64), self.views, self.intrinsics)
        self.assertTrue((nothing.interpolate(np.zeros((0, 5))) == np.zeros((*nothing.face_id.shape, 5))).all())
        faces[1, 0, 1] = -1
        with self.assertRaisesRegex(ValueError, "-1 behind it"):
            RENDERER.rasterize(vertices, faces, self.views, self.intrinsics)

    def test_lists_of_meshes(self):
        """As padded arrays have them, and each mesh by itself; gradients are of each mesh's own shape."""
        meshes = [TETRAHEDRON, SQUARE[:0], 0.8 * SQUARE, TETRAHEDRON], [FACES, FACES[:0], SQUARE_FACES, FACES]
        views, intrinsics = cameras(4)
        colors, weights = [random(len(mesh), 3, seed=4) for mesh in meshes[0]], random(4, SIZE, SIZE, 3, seed=3) - 0.5
        ways = {"vertices": [random(2, *mesh.shape, seed=7) - 0.5 for mesh in meshes[0]], "views": random(2, 4, 4, 4)}
        padded = [np.stack([np.pad(row, ((0, 5 - len(row)), (0, 0)), constant_values=value) for row in rows])
                  for rows, value in ((meshes[0], 99), (meshes[1], -1), (colors, 0))]

        def rasterized(vertices, faces, colors, rows=slice(None)):
            samples = RENDERER.rasterize(vertices, faces, views[rows], intrinsics[rows])
            values = samples.interpolate(colors)
            image, resolved = samples.resolve_with_vjp(values)
            grad_values, by_contours = resolved(weights[rows])
            corners = samples.pullback(grad_values, grad_values[..., 0])
            return samples, (values, image), (by_contours, corners)

        samples, found, gradients = rasterized(*meshes, colors)
        of_padded, expected, gradients_of_padded = rasterized(*padded)
        np.testing.assert_array_equal(samples.face_id, of_padded.face_id)
        for array, wanted in zip(found, expected):
            self.check_close(array, wanted, 1e-6)
        for gradient, wanted in zip(gradients, gradients_of_padded):
            for name in ("views", "intrinsics"):
                self.check_close(gradient[name], wanted[name], 1e-5)
            for i, mesh in enumerate(meshes[0]):
                self.assertEqual(gradient["vertices"][i].shape, mesh.shape)
                np.testing.assert_allclose(gradient["vertices"][i], wanted["vertices"][i, :len(mesh)],
                                           atol=1e-5 * np.abs(wanted["vertices"]).max())
        tangents = samples.resolve_with_jvp(found[0], tangents=ways)[1], samples.jvp(ways)[1]
        for i in (0, 2, 3):
            row = slice(i, i + 1)
            alone, (_, image), of_mesh = rasterized(meshes[0][i], meshes[1][i], colors[i], row)
            self.check_close(found[1][row], image, 1e-6)
            for gradient, wanted in zip(gradients, of_mesh):
                self.check_close(gradient["vertices"][i], wanted["vertices"], 1e-5)
                self.check_close(gradient["views"][row], wanted["views"], 1e-5)
            of_mesh = {"vertices": ways["vertices"][i], "views": ways["views"][:, row]}
            wanted = alone.resolve_with_jvp(found[0][row], tangents=of_mesh)[1], alone.jvp(of_mesh)[1]
            for tangent, own in zip(tangents, wanted):
                self.check_close(tangent[:, row], own, 1e-5)
        # Attributes of the corners, which the faces share out among each other.
        corners = [mesh[own].reshape(-1, 3) for mesh, own in zip(colors, meshes[1])]
        indices = [np.arange(own.size).reshape(-1, 3) for own in meshes[1]]
        np.testing.assert_array_equal(samples.interpolate(corners, indices), found[0])
        with self.assertWarnsRegex(UserWarning, "every triangle was dropped"):
            nothing = RENDERER.rasterize([SQUARE[:0]] * 2, [FACES[:0]] * 2, views[:2], intrinsics[:2])
        self.assertTrue(not nothing.mask.any() and (nothing.interpolate([np.zeros((0, 2))] * 2) == 0).all())
        of_all = RENDERER.rasterize([TETRAHEDRON], [FACES], views, intrinsics)
        np.testing.assert_array_equal(of_all.face_id, RENDERER.rasterize(TETRAHEDRON, FACES, views, intrinsics).face_id)
        (gradient,) = of_all.pullback(depth=of_all.depth)["vertices"]
        self.check_close(gradient, RENDERER.rasterize(TETRAHEDRON, FACES, views, intrinsics).pullback(
            depth=of_all.depth)["vertices"], 1e-5)
        self.assertEqual(of_all.interpolate([COLORS]).shape, (*of_all.face_id.shape, 3))

    @unittest.skipUnless(torch, "no PyTorch")
    def test_lists_of_tensors(self):
        leaves = [torch.from_numpy(array.copy()).requires_grad_() for array in (TETRAHEDRON, SQUARE[:0], 0.8 * SQUARE)]
        colors = [torch.from_numpy(random(len(leaf), 3, seed=4)).requires_grad_() for leaf in leaves]
        faces = [torch.from_numpy(array) for array in (FACES, FACES[:0], SQUARE_FACES)]
        order, weights = [2, 0, 1, 2], torch.from_numpy(random(4, SIZE, SIZE, 3, seed=3) - 0.5)  # two share their arrays
        views, intrinsics = map(torch.from_numpy, cameras(4))
        views.requires_grad_()

        def shown(given, rows=slice(None)):
            vertices, faces, colors = given
            samples = RENDERER.rasterize(vertices, faces, views[rows], intrinsics[rows])
            image = samples.resolve(samples.interpolate(colors))
            (image * weights[rows]).sum().backward()
            return image.detach()

        image = shown([[given[i] for i in order] for given in (leaves, faces, colors)])
        found, tensors = [], [*leaves, *colors, views]
        for tensor in tensors:
            found.append(tensor.grad)
            tensor.grad = None
        for row, i in enumerate(order):
            if len(faces[i]):
                alone = shown([given[i] for given in (leaves, faces, colors)], slice(row, row + 1))
                self.check_close(image[row:row + 1], alone, 1e-6)
        for gradient, tensor in zip(found, tensors):
            if tensor.numel():
                self.check_close(gradient, tensor.grad, 1e-5)
            else:
                self.assertEqual(gradient.shape, tensor.shape)

    def test_what_is_refused_of_lists(self):
        vertices, faces = [TETRAHEDRON, SQUARE], [FACES, SQUARE_FACES]
        wrong = SQUARE.copy()
        wrong[3] = np.nan
        for given, words in (((vertices, [FACES + 1, SQUARE_FACES]), r"faces\[1\] \(view 0\): got vertex 4"),
                             ((vertices, [FACES, SQUARE_FACES + 1]), r"faces\[0\] \(view 1\): got vertex 5"),
                             ((vertices, [FACES, SQUARE_FACES[:3, :2]]), r"faces \(view 1\): got \[3, 2\]"),
                             (([TETRAHEDRON, wrong], faces), r"vertices\[3\] \(view 1\): got \(nan"),
                             (([TETRAHEDRON, SQUARE[:3, :2]], [FACES, FACES[:1]]), r"vertices \(view 1\): got \[3, 2\]"),
                             ((vertices[:1], faces), "vertices .*a list of 2"),
                             ((np.stack([TETRAHEDRON] * 2), faces), "vertices .*a list of 2")):
            with self.subTest(words), self.assertRaisesRegex(ValueError, words):
                RENDERER.rasterize(*given, self.views, self.intrinsics)
        samples = RENDERER.rasterize(vertices, faces, self.views, self.intrinsics)
        colors = [random(4, 3), random(5, 3)]
        for given, words in (([colors[:1]], "attributes .*1 meshes, expected a list of 2"),
                             ([colors[1]], r"attributes .*\[5, 3\], expected a list of 2"),
                             ([colors[::-1]], r"attributes\[0\] .*\[5, 3\], expected \[V, C\], V: 4"),
                             ([[colors[0], colors[1][:, :2]]], r"attributes\[1\] .*\[5, 2\], expected \[V, 3\]"),
                             ([colors, FACES], "faces .*ndarray, expected a list of 2"),
                             ([colors, [FACES, FACES]], r"faces\[1\] .*\[4, 3\], expected \[5, 3\]"),
                             ([colors, [FACES + 1, SQUARE_FACES]], r"attributes\[0\] .*indices from 1 to 4")):
            with self.subTest(words), self.assertRaisesRegex(ValueError, words):
                samples.interpolate(*given)

    def test_gradients_too_large_for_their_differences(self):
        samples = RENDERER.rasterize(*self.arguments())
        for numbers in ([3e38, -3e38, 0], [0, 0, np.nan]):
            with self.assertRaisesRegex(ValueError, "grad_barycentrics.*finite numbers"):
                samples.pullback(barycentrics=np.broadcast_to(np.float32(numbers), samples.barycentrics.shape))

    def test_covered_samples_alone(self):
        """The same numbers as of all samples: shared tables, those of views, faces of views, lists, layers."""
        square = np.concatenate([0.9 * SQUARE[:3], SQUARE[:1]])
        shapes = np.stack([TETRAHEDRON, 0.8 * TETRAHEDRON])
        padded = np.stack([FACES, np.concatenate([FACES[:1], -np.ones((3, 3), np.int64)])])
        lists = [TETRAHEDRON, SQUARE], [FACES, SQUARE_FACES]
        for name, (vertices, faces), given in (
                ("shared", (TETRAHEDRON, FACES), (COLORS,)), ("of views", (shapes, FACES), (random(2, 4, 5, seed=2),)),
                ("one row", (shapes, FACES), (COLORS[None],)),
                ("own faces", (TETRAHEDRON, FACES), (random(7, 2, seed=1), FACES + 3)),
                ("faces of views", (np.stack([TETRAHEDRON, square]), padded), (random(2, 4, 3, seed=8),)),
                ("shared by views", (np.stack([TETRAHEDRON, square]), padded), (COLORS,)),
                ("list", lists, ([random(4, 3, seed=1), random(5, 3, seed=2)],))):
            with self.subTest(name):
                whole = RENDERER.rasterize(vertices, faces, self.views, self.intrinsics, layers=2)
                for samples in whole.layers:
                    self.assertTrue(samples.mask.any())
                    values, rows = samples.interpolate(*given), samples.interpolate(*given, covered=True)
                    np.testing.assert_array_equal(rows, values[samples.mask])
                    np.testing.assert_array_equal(samples.resolve(rows), samples.resolve(values))
                    image, pullback = samples.resolve_with_vjp(rows)
                    expected, of_all = samples.resolve_with_vjp(values)
                    np.testing.assert_array_equal(image, expected)
                    weights = np.resize(WEIGHTS, image.shape)
                    (found, scene), (grad_values, by_name) = pullback(weights), of_all(weights)
                    np.testing.assert_array_equal(found, grad_values[samples.mask])
                    np.testing.assert_array_equal(scene["views"], by_name["views"])
                    samples.resolve_with_vjp(values)[1](weights)  # of values that the frame keeps
                    _, again = samples.resolve_with_vjp(rows)
                    samples.jvp({"vertices": [mesh[None] for mesh in vertices] if isinstance(vertices, list) else vertices[None]})
                    np.testing.assert_array_equal(again(weights)[0], found)
                    moved = random(2, *rows.shape, seed=6)
                    spread = np.zeros((2, *values.shape), np.float32)
                    spread[:, samples.mask] = moved
                    np.testing.assert_array_equal(*(samples.resolve_with_jvp(*given)[1]
                                                    for given in ((rows, moved), (values, spread))))
        faces, table = np.tile(FACES, (64, 1)), random(144, 6, seed=3)  # which the library gets packed, in memory of their own
        many = RENDERER.rasterize(np.resize(TETRAHEDRON, (144, 3)), faces, self.views, self.intrinsics)
        for given in ((table[:, :2],), (table[:, ::3], faces), (table[:, ::3], faces[:, ::-1])):
            np.testing.assert_array_equal(many.interpolate(*given, covered=True), many.interpolate(*given)[many.mask])
        with self.assertRaisesRegex(ValueError, rf"values .*got \[{len(rows) - 1}, 3\], .*or \[{len(rows)}, C\]"):
            samples.resolve(rows[1:])
        with self.assertRaisesRegex(ValueError, r"tangents of values .*got \[2, 54, 3\], expected \[K, 55, 3\]"):
            samples.resolve_with_jvp(rows, moved[:, 1:])
        with self.assertRaisesRegex(TypeError, "covered .*ndarray"):
            samples.interpolate([COLORS, COLORS], covered=samples.mask)
        with self.assertWarns(UserWarning):
            nothing = RENDERER.rasterize(TETRAHEDRON + np.float32([99, 0, 0]), FACES, self.views, self.intrinsics)
        rows = nothing.interpolate(COLORS, covered=True)
        self.assertEqual(rows.shape, (0, 3))
        self.assertTrue((nothing.resolve(rows) == 0).all())

    @unittest.skipUnless(torch, "no PyTorch")
    def test_covered_samples_of_tensors(self):
        leaves = [torch.from_numpy(array.copy()).requires_grad_() for array in (TETRAHEDRON, random(2, 4, 3, seed=8))]
        weights = torch.from_numpy(WEIGHTS[..., :3].copy())
        gradients = []
        for covered in (False, True):
            samples = RENDERER.rasterize(leaves[0], torch.from_numpy(FACES), self.views, self.intrinsics)
            values = samples.interpolate(leaves[1], covered=covered)
            self.assertEqual(values.ndim, 2 if covered else 4)
            image = samples.resolve(values * values)
            gradients.append([image.detach(), *torch.autograd.grad((image * weights).sum(), leaves)])
        for found, wanted in zip(*gradients):
            self.check_close(found, wanted, 1e-6)
        second = []
        for covered in (False, True):  # of a square of each value, by the attributes
            samples = RENDERER.rasterize(leaves[0].detach(), torch.from_numpy(FACES), self.views, self.intrinsics)
            values = samples.interpolate(leaves[1], covered=covered)
            first, = torch.autograd.grad(values.square().sum(), leaves[1], create_graph=True)
            second.append(torch.autograd.grad(first.square().sum(), leaves[1])[0])
        self.check_close(*second, 1e-5)
        # Several images of one frame, in whatever order they are differentiated.
        def resolved(*numbers):
            samples = RENDERER.rasterize(leaves[0], torch.from_numpy(FACES), self.views, self.intrinsics)
            values = samples.interpolate(leaves[1], covered=True)
            return [samples.resolve((values, torch.cat((values, values), -1), values * values)[i])[..., :3] for i in numbers]

        images = resolved(0, 1, 2)
        for i in (2, 0, 1, 2):
            found = torch.autograd.grad((images[i] * weights).sum(), leaves, retain_graph=True)
            for ours, alone in zip(found, torch.autograd.grad((resolved(i)[0] * weights).sum(), leaves)):
                self.check_close(ours, alone, 1e-6)
        with self.assertWarns(UserWarning):
            nothing = RENDERER.rasterize(leaves[0][:0], torch.zeros(0, 3, dtype=torch.int64), self.views, self.intrinsics)
        rows = nothing.interpolate(torch.zeros(0, 3), covered=True)
        self.assertEqual((tuple(rows.shape), float(nothing.resolve(rows).detach().abs().max())), ((0, 3), 0.0))
        if hasattr(torch, "func"):
            def shown(vertices):
                samples = RENDERER.rasterize(vertices, torch.from_numpy(FACES), self.views, self.intrinsics)
                return samples.resolve(samples.interpolate(leaves[1].detach(), covered=True))
            moved = torch.from_numpy(random(4, 3, seed=9))
            image, tangent = torch.func.jvp(shown, (leaves[0].detach(),), (moved,))
            gradient, = torch.autograd.grad((shown(leaves[0]) * weights).sum(), leaves[0])
            self.check_close((tangent * weights).sum(), (moved * gradient).sum(), 1e-4)

    def test_layers(self):
        samples = RENDERER.rasterize(*self.arguments(), layers=3)
        front, back, none = samples.layers
        for name in ("face_id", "barycentrics", "depth"):
            self.assertTrue((getattr(samples, name) == getattr(front, name)).all())
        # A tetrahedron has a front and a back.
        self.assertTrue((front.mask == back.mask).all() and front.mask.any() and not none.mask.any())
        self.assertTrue((back.depth >= front.depth).all() and (back.face_id != front.face_id)[front.mask].all())
        # The whole way through the body, by its gradient: two layers of depths, which move apart.
        thickness = (back.depth - front.depth)[..., None]
        image, by_contours = front.resolve_with_vjp(thickness)
        grad_values, by_name = by_contours(np.ones_like(image))
        inside = back.pullback(depth=grad_values[..., 0])["vertices"] + front.pullback(depth=-grad_values[..., 0])["vertices"]

        def total(scale):
            layers = RENDERER.rasterize(*self.arguments((scale * TETRAHEDRON).astype(np.float32)), layers=2).layers
            return float(layers[0].resolve((layers[1].depth - layers[0].depth)[..., None]).sum(dtype=np.float64))
        measured = (total(1.05) - total(0.95)) / 0.1
        along = float(((inside + by_name["vertices"]) * TETRAHEDRON).sum())
        self.assertLess(abs(along - measured), 0.02 * abs(measured))

    @unittest.skipUnless(torch, "no PyTorch")
    def test_see_through(self):
        """Two walls, one before the other: the further one's outline has a gradient as far as it is seen."""
        corners = np.float32([[-1, -1], [1, -1], [1, 1], [-1, 1]])
        near = np.concatenate([9 * corners, np.full((4, 1), 1)], 1)
        far = torch.tensor(np.concatenate([0.5 * corners, np.zeros((4, 1))], 1), dtype=torch.float32, requires_grad=True)
        faces = torch.tensor([[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]])
        view = torch.eye(4)[None].clone()
        view[0, 2, 3] = -5
        renderer = dpr.Renderer(SIZE, SIZE, blur=0.5, znear=1.0, zfar=20.0)
        for layers, jump in ((2, 0.75), (1, 0.0)):
            vertices = torch.cat([torch.tensor(near, dtype=torch.float32), far])
            samples = renderer.rasterize(vertices, faces, view, torch.tensor([[2.0]]), layers=layers)
            shown = torch.zeros(samples.face_id.shape)
            for layer in reversed(samples.layers):
                alpha = torch.where(layer.face_id < 2, 0.25, 1.0) * layer.mask
                shown = alpha * layer.mask + (1 - alpha) * shown - alpha * (layer.face_id < 2)
            image = samples.resolve(shown[..., None])
            pixels_a_unit = SIZE / 2
            self.assertAlmostEqual(float(image.detach().sum()), jump * pixels_a_unit**2, delta=0.01 * pixels_a_unit**2)
            gradient, = torch.autograd.grad(image.sum(), far)
            right = float(gradient[1, 0] + gradient[2, 0])
            self.assertAlmostEqual(right, jump * pixels_a_unit**2, delta=2e-3 * pixels_a_unit**2)

    def check_transposed(self, tangents, weights, moved, gradients):
        """<u, J v> = <J^T u, v>, a row a direction."""
        for k, tangent in enumerate(tangents):
            terms = np.asarray(tangent, np.float64) * weights
            by_gradient = sum((np.asarray(moved[name][k], np.float64) * gradient).sum() for name, gradient in gradients.items())
            self.assertGreater(abs(by_gradient), 0)
            self.assertLess(abs(terms.sum() - by_gradient), 2e-5 * np.abs(terms).sum())

    def test_forward_mode(self):
        arrays = dict(zip(("vertices", "views", "intrinsics"), (TETRAHEDRON, self.views, self.intrinsics)))
        moved = {name: random(3, *array.shape, seed=i) - 0.5 for i, (name, array) in enumerate(arrays.items())}
        samples = RENDERER.rasterize(*self.arguments(), layers=2)
        for layer in samples.layers:
            barycentrics, depth = layer.jvp(moved)
            for weights, tangents, name in ((random(*layer.barycentrics.shape, seed=4), barycentrics, "barycentrics"),
                                            (random(*layer.depth.shape, seed=5), depth, "depth")):
                self.check_transposed(tangents, weights, moved, layer.pullback(**{name: weights}))
        values, moved_values = random(*samples.face_id.shape, 5, seed=6), random(3, *samples.face_id.shape, 5, seed=7)
        weights = random(2, SIZE, SIZE, 5, seed=8) - 0.5
        images, pullback = samples.resolve_with_vjp(values)
        grad_values, by_name = pullback(weights)
        found, tangents = samples.resolve_with_jvp(values, moved_values, moved)
        self.assertTrue((found == images).all())
        self.check_transposed(tangents, weights, {**moved, "values": moved_values}, {**by_name, "values": grad_values})
        self.check_transposed(samples.resolve_with_jvp(values, moved_values)[1], weights, {"values": moved_values},
                              {"values": grad_values})
        self.check_transposed(samples.resolve_with_jvp(values, tangents=moved)[1], weights, moved, by_name)
        with self.assertRaisesRegex(ValueError, "tangents"):
            samples.resolve_with_jvp(values)
        with self.assertRaisesRegex(ValueError, "tangents of vertices"):
            samples.jvp({"vertices": TETRAHEDRON})
        with self.assertRaisesRegex(ValueError, "tangents of values"):
            samples.resolve_with_jvp(values, moved_values[:, 1:])

    @unittest.skipUnless(torch, "no PyTorch")
    def test_forward_mode_of_pytorch(self):
        faces, weights = torch.from_numpy(FACES), torch.from_numpy(WEIGHTS)
        vertices, views, intrinsics, colors = map(torch.from_numpy, (TETRAHEDRON, self.views, self.intrinsics, COLORS))
        way = torch.from_numpy(random(*TETRAHEDRON.shape, seed=2) - 0.5)

        def shaded_by(vertices, colors):
            samples = RENDERER.rasterize(vertices, faces, views, intrinsics)
            return samples.resolve(torch.cat([samples.interpolate(colors), samples.depth[..., None]], -1))

        leaf, color = vertices.clone().requires_grad_(), colors.clone().requires_grad_()
        gradients = torch.autograd.grad((shaded_by(leaf, color) * weights).sum(), (leaf, color))
        if not hasattr(torch, "func"):
            with torch.autograd.forward_ad.dual_level(), self.assertRaisesRegex(ValueError, "PyTorch before 2.0"):
                shaded_by(torch.autograd.forward_ad.make_dual(vertices, way), colors)
            return
        with torch.autograd.forward_ad.dual_level():
            duals = map(torch.autograd.forward_ad.make_dual, (vertices, colors), (way, colors))
            image, tangent = torch.autograd.forward_ad.unpack_dual(shaded_by(*duals))
        self.check_close(image, shaded_by(vertices, colors), 1e-6)
        wanted = float((gradients[0] * way).sum() + (gradients[1] * colors).sum())
        self.assertAlmostEqual(float((tangent * weights).sum()), wanted, delta=1e-4 * abs(wanted))

        def of_two(numbers):
            return shaded_by(vertices + numbers[0] * way, colors + numbers[1])
        jacobian = torch.func.jacfwd(of_two)(torch.zeros(2))
        self.assertEqual(jacobian.shape, (2, SIZE, SIZE, 4, 2))
        for k, expected in enumerate((gradients[0] * way, gradients[1])):
            found = float((jacobian[..., k] * weights).sum())
            self.assertAlmostEqual(found, float(expected.sum()), delta=1e-4 * abs(found))

    def test_any_number_of_channels(self):
        samples = RENDERER.rasterize(*self.arguments())
        values = random(*samples.face_id.shape, 7, seed=1)
        images = samples.resolve(values)
        self.assertEqual(images.shape, (2, SIZE, SIZE, 7))
        for channel in range(7):
            self.assertTrue((samples.resolve(values[..., channel:channel + 1])[..., 0] == images[..., channel]).all())

    def test_what_is_refused(self):
        samples = RENDERER.rasterize(*self.arguments())
        with self.assertRaisesRegex(ValueError, r"values .*expected \[2, "):
            samples.resolve(np.zeros((2, SIZE, SIZE, 3), np.float32))
        with self.assertRaisesRegex(ValueError, "finite"):
            samples.resolve(np.full((*samples.face_id.shape, 1), np.nan, np.float32))
        with self.assertRaisesRegex(ValueError, "noise on the pixel"):
            dpr.rasterize(*self.arguments(), width=SIZE, height=SIZE, preset="gaussian")
        with self.assertRaisesRegex(ValueError, "barycentrics"):
            samples.pullback(barycentrics=np.zeros(3, np.float32))
        for rows in (np.zeros(4), np.zeros((3, 2)), np.zeros((5, 2)), np.zeros((3, 4, 2))):
            with self.assertRaisesRegex(ValueError, r"attributes .*\[V, C\] or \[2, V, C\], V: 4"):
                samples.interpolate(rows)
        for faces, words in ((FACES[:1], r"faces .*\[4, 3\]"), (FACES - 1, "attributes .*indices from -1 to 2"),
                             (FACES + 1, "attributes .*indices from 1 to 4")):
            with self.assertRaisesRegex(ValueError, words):
                samples.interpolate(COLORS, faces)
        with self.assertRaisesRegex(ValueError, r"values .*expected \[2, [0-9]+, [0-9]+, C\]"):
            samples.resolve(samples.depth)
        with self.assertRaisesRegex(TypeError, "values .*got str"):
            samples.resolve("depth")
        for call in (RENDERER.rasterize, lambda *given, **named: dpr.rasterize(*given, width=SIZE, height=SIZE, **named)):
            with self.assertRaisesRegex(TypeError, "did you mean 'layers'"):
                call(*self.arguments(), layer=2)
        with self.assertWarnsRegex(UserWarning, "every triangle was dropped"):
            RENDERER.rasterize(*self.arguments(TETRAHEDRON + np.float32([0, 0, 100])))
        for layers in (0, 257, 1.5, "many"):
            with self.assertRaisesRegex(ValueError, f"layers .*{layers}.*a whole number"):
                RENDERER.rasterize(*self.arguments(), layers=layers)
        with self.assertRaisesRegex(ValueError, "layers"):
            dpr.Renderer(SIZE, SIZE, layers=2)

    @unittest.skipUnless(torch, "no PyTorch")
    def test_what_is_refused_of_tensors(self):
        plain = [torch.from_numpy(array) for array in self.arguments()]
        samples = RENDERER.rasterize(*plain)
        with self.assertRaisesRegex(ValueError, "tangents of vertices .*required no gradient"):
            samples.jvp({"vertices": torch.ones(1, 4, 3)})
        with self.assertRaisesRegex(ValueError, "pullback.. .*without gradients"):
            samples.pullback(depth=samples.depth)
        by_numpy = samples.resolve(samples.depth[..., None].numpy())
        self.assertTrue(torch.equal(by_numpy, samples.resolve(samples.depth[..., None])))
        self.assertTrue(torch.equal(samples.interpolate(COLORS), samples.interpolate(torch.from_numpy(COLORS))))
        of_numpy = RENDERER.rasterize(*self.arguments())
        leaf = torch.from_numpy(COLORS.copy()).requires_grad_()
        for call in (of_numpy.interpolate, of_numpy.resolve):
            with self.assertRaisesRegex(ValueError, "requires a gradient"):
                call(leaf)
        vertices = plain[0].clone().requires_grad_()
        for of in ("barycentrics", "contours"):
            samples = RENDERER.rasterize(vertices, *plain[1:])
            values = samples.interpolate(vertices)
            loss = values.square().sum() if of == "barycentrics" else samples.resolve(values.detach()).square().sum()
            gradient, = torch.autograd.grad(loss, vertices, create_graph=True)
            with self.assertRaisesRegex(RuntimeError, "second"):
                torch.autograd.grad(gradient.square().sum(), vertices)

    def test_a_process_ends_while_its_driver_compiles(self):
        program = ("import numpy as np, dpr\n"
                   "view = np.eye(4, dtype=np.float32)[None]; view[0, 2, 3] = -4\n"
                   "lens = np.float32([[16, 16, 8, 8]])\n"
                   "try: dpr.rasterize(view[0, :3, :3], np.array([[0, 1, 2]]), view, lens, width=16, height=16, preset='gaussian')\n"
                   "except ValueError as error: print(error)\n")
        with tempfile.TemporaryDirectory() as folder:  # no kernel has been compiled
            run = subprocess.run([sys.executable, "-c", program], env={**os.environ, "POCL_CACHE_DIR": folder},
                                 capture_output=True, text=True)
        self.assertEqual((run.returncode, run.stderr), (0, ""))
        self.assertIn("noise on the pixel", run.stdout)


if __name__ == "__main__":
    unittest.main()
