"""The Python package `dpr`, by PYTHONPATH or installed, with whatever PyTorch is there: one file for all versions."""
import copy
import importlib
import io
import multiprocessing
import pickle
import subprocess
import sys
import threading
import unittest
import warnings

try:
    import torch
except ImportError:
    print("skipped: no python3-torch")
    sys.exit(0)

import dpr

SIZE = 16
FACES = torch.tensor([[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]])
# No side is seen edge-on, and no pixel lies as near to one edge as to another: the image has kinks there.
TETRAHEDRON = torch.tensor([[0.1, 0.9, 0.2], [-0.8, -0.3, 0.5], [0.9, -0.5, 0.4], [0.05, 0.25, -0.9]])
TETRAHEDRON += 0.05 * (torch.rand(4, 3, generator=torch.Generator().manual_seed(10)) - 0.5)
SQUARE = torch.tensor([[-0.7, -0.6, 0.1], [0.8, -0.7, 0.0], [0.6, 0.7, -0.1], [-0.75, 0.65, 0.2], [0.0, 0.0, 0.3]])
SQUARE_FACES = torch.tensor([[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4], [0, 2, 1]])
SMOOTH = {"preset": "joint_gaussian", "sigma": 5e-3, "gamma": 5e-2, "occupancy_threshold": 1e-6, "znear": 1, "zfar": 10}
RELEASE = tuple(int(number) for number in torch.__version__.split(".")[:2])


def cameras(count):
    """Looking at the origin from +z, each a little further away."""
    views = torch.eye(4).repeat(count, 1, 1)
    views[:, 2, 3] = -4.0 - 0.3 * torch.arange(count)
    return views, torch.tensor([20.0, 20.0, 8.1, 7.9]).repeat(count, 1)


def random(*shape, seed=1):
    return torch.rand(*shape, generator=torch.Generator().manual_seed(seed))


def image_of(renderer):
    """Images that a process of its own renders."""
    return renderer(TETRAHEDRON, FACES, *cameras(1))


def put_image_or_error(queue, renderer):
    try:
        queue.put(image_of(renderer).tolist())
    except RuntimeError as error:
        queue.put(str(error))


def in_process(method, renderer):
    """Result of put_image_or_error() in a process that is started by that method."""
    context = multiprocessing.get_context(method)
    queue = context.Queue()
    process = context.Process(target=put_image_or_error, args=(queue, renderer))
    process.start()
    found = queue.get(timeout=120)
    process.join(60)
    assert process.exitcode == 0, process.exitcode
    return found


class Images(torch.utils.data.Dataset):
    """Rendered where they are asked for."""

    def __init__(self, renderer):
        self.renderer = renderer

    def __len__(self):
        return 4

    def __getitem__(self, index):
        return image_of(self.renderer)[0] + index


def nested(arguments):
    """"lights.ambient" as an entry of a dictionary, "textures.0" of a list."""
    found = {}
    for name, value in arguments.items():
        outer, _, inner = name.partition(".")
        if inner.isdigit():
            found.setdefault(outer, []).append(value)
        elif inner:
            found.setdefault(outer, {})[inner] = value
        else:
            found[outer] = value
    return found


class RenderTest(unittest.TestCase):
    def assert_same(self, found, expected, tolerance=0.0):
        self.assertEqual(found.shape, expected.shape)
        self.assertLessEqual((found - expected).abs().max().item(), tolerance)

    def check_gradients(self, settings, tensors, constants):
        """In double precision outside, single inside: the step is as large as that needs."""
        settings = dict(settings)
        renderer = dpr.Renderer(SIZE, SIZE, **settings)
        names = list(tensors)
        last = torch.tensor([0.0, 0.0, 0.0, 1.0])
        weights = random(2, SIZE, SIZE, 4, seed=3).double() - 0.5

        def loss(*values):
            given = {name: value.float() for name, value in zip(names, values)}
            if "rows" in given:  # of the matrices, whose last ones are fixed
                given["views"] = torch.cat((given.pop("rows"), last.expand(2, 1, 4)), 1)
            return (renderer(**nested({"faces": FACES, **given, **constants})).double() * weights).sum()

        doubles = [tensor.double().requires_grad_() for tensor in tensors.values()]
        self.assertTrue(torch.autograd.gradcheck(loss, doubles, eps=1e-3, atol=5e-3, rtol=1e-3))


class PackageTest(RenderTest):
    def test_gradients(self):
        views, intrinsics = cameras(2)
        self.check_gradients(SMOOTH, {"vertices": TETRAHEDRON.repeat(2, 1, 1), "colors": random(2, 4, 3),
                                      "rows": views[:, :3], "intrinsics": intrinsics,
                                      "background": torch.tensor([0.1, 0.2, 0.3])}, {})
        lights = {"lights.ambient": torch.tensor([0.2, 0.3, 0.4]), "lights.point": random(2, 9, seed=4) + 2}
        self.check_gradients(SMOOTH, {"face_colors": random(4, 3), **lights},
                             {"vertices": TETRAHEDRON, "views": views, "intrinsics": intrinsics})

    def test_gradients_of_the_smoothing(self):
        views, intrinsics = cameras(2)
        constants = {"vertices": TETRAHEDRON, "colors": random(4, 3), "views": views, "intrinsics": intrinsics}
        scale = {"sigma": 0.05, "gamma": 0.3, "alpha": 1.0}  # for steps of 1e-3
        barrier = {**SMOOTH, "preset": "gaussian"}
        self.check_gradients(barrier, {name: torch.tensor(value) for name, value in scale.items()}, constants)
        self.check_gradients({"znear": 1, "zfar": 10}, {"sigma": torch.tensor(0.05)}, constants)

    def test_numbers_of_a_call_are_the_settings(self):
        views, intrinsics = cameras(1)
        sigma = 2e-3
        expected = dpr.render(TETRAHEDRON, FACES, views, intrinsics, width=SIZE, height=SIZE, preset="gaussian",
                              sigma=sigma)
        renderer = dpr.Renderer(SIZE, SIZE, preset="gaussian")
        self.assert_same(renderer(TETRAHEDRON, FACES, views, intrinsics, sigma=sigma), expected)
        self.assert_same(renderer(TETRAHEDRON, FACES, views, intrinsics, sigma=torch.tensor([sigma])), expected, 1e-6)
        self.assertGreater((renderer(TETRAHEDRON, FACES, views, intrinsics) - expected).abs().max(), 1e-3)

    def test_as_many_faces_as_vertices(self):
        views, intrinsics = cameras(1)
        colors = random(4, 3)
        images = [dpr.render(TETRAHEDRON, FACES, views, intrinsics, width=SIZE, height=SIZE, blur=0.25, **{name: colors})
                  for name in ("colors", "face_colors")]
        self.assertGreater((images[0] - images[1]).abs().max(), 0.01)
        self.assertLess(images[1][0, 8, 8, :3].sub(colors).abs().amax(1).min(), 1e-3)  # a face's own colour

    def test_planes_follow_the_depths(self):
        for scale, planes in [(1.0, (2, 8)), (250.0, (512, 2048))]:
            views, intrinsics = cameras(1)
            views[:, 2, 3] *= scale
            vertices = scale * TETRAHEDRON
            settings = {"width": SIZE, "height": SIZE, "preset": "joint_gaussian", "sigma": 1e-3, "gamma": 0.1}
            image = dpr.render(vertices, FACES, views, intrinsics, **settings)
            self.assertGreater(image[..., 3].sum(), 10)
            given = {"znear": planes[0], "zfar": planes[1]}
            self.assert_same(image, dpr.render(vertices, FACES, views, intrinsics, **given, **settings))
        # The camera in the mesh: the near plane is a part of the far one.
        views[:, 2, 3] = 0
        self.assertGreater(dpr.render(TETRAHEDRON, FACES, views, intrinsics, width=SIZE, height=SIZE)[..., 3].sum(), 10)

    def test_warns_where_nothing_is_rendered(self):
        views, intrinsics = cameras(1)
        with self.assertWarnsRegex(UserWarning, "every triangle was dropped"):
            dpr.render(TETRAHEDRON, FACES, views, intrinsics, width=SIZE, height=SIZE, znear=50, zfar=60)
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            image_of(dpr.Renderer(SIZE, SIZE))

    def test_meshes_that_differ(self):
        views, intrinsics = cameras(2)
        renderer = dpr.Renderer(SIZE, SIZE, **SMOOTH)
        colors = [random(4, 3), random(5, 3, seed=2)]

        def leaves():
            return [mesh.clone().requires_grad_() for mesh in (TETRAHEDRON, SQUARE)]

        alone, listed, padded = leaves(), leaves(), leaves()
        faces = [FACES, SQUARE_FACES]
        expected = torch.cat([renderer(v, f, views[i:i + 1], intrinsics[i:i + 1], colors=c)
                              for i, (v, f, c) in enumerate(zip(alone, faces, colors))])
        found = renderer(listed, faces, views, intrinsics, colors=colors)
        pad = torch.nn.utils.rnn.pad_sequence
        padded_faces = pad(faces, batch_first=True, padding_value=-1)
        of_padded = renderer(pad(padded, batch_first=True), padded_faces, views, intrinsics,
                             colors=pad(colors, batch_first=True))
        for images, meshes in [(found, listed), (of_padded, padded)]:
            self.assert_same(images, expected)
            images.square().sum().backward()
        expected.square().sum().backward()
        for i in range(2):
            self.assertGreater(alone[i].grad.abs().sum(), 0)
            self.assert_same(listed[i].grad, alone[i].grad)
            self.assert_same(padded[i].grad, alone[i].grad)
        with self.assertRaisesRegex(ValueError, "vertices .* got 1 meshes, expected a list of 2"):
            renderer([TETRAHEDRON], faces, views, intrinsics)
        with self.assertRaisesRegex(ValueError, "colors .* got Tensor, expected a list of 2"):
            renderer(listed, faces, views, intrinsics, colors=colors[0])
        with self.assertRaisesRegex(ValueError, "vertices .* got 3 in the first dimension, expected 2"):
            renderer(pad([TETRAHEDRON] * 3, batch_first=True), padded_faces, views, intrinsics)
        with self.assertRaisesRegex(ValueError, r"intrinsics .* got \[3, 4\], expected \[2, 4\] or \[2, 9\]"):
            renderer(listed, faces, views, cameras(3)[1])
        with self.assertRaisesRegex(ValueError, r"views .* got \[0, 4, 4\], expected at least one view"):
            renderer([], [], views[:0], intrinsics[:0])
        padded_faces[1, 0, 1] = -1
        with self.assertRaisesRegex(ValueError, "faces .* -1 behind it"):
            renderer(pad(leaves(), batch_first=True), padded_faces, views, intrinsics)

    def test_sampled_noise_is_of_the_place_in_the_batch(self):
        views, intrinsics = cameras(1)
        views, intrinsics = views.repeat(2, 1, 1), intrinsics.repeat(2, 1)
        renderer = dpr.Renderer(SIZE, SIZE, **SMOOTH, estimator="monte_carlo", samples=4)
        together = renderer(TETRAHEDRON, FACES, views, intrinsics)
        self.assert_same(renderer([TETRAHEDRON] * 2, [FACES] * 2, views, intrinsics), together)
        self.assertGreater((together[0] - together[1]).abs().max(), 1e-3)

    def test_outputs(self):
        views, intrinsics = cameras(2)
        wall = torch.tensor([[-9.0, -9.0, 0.0], [9.0, -9.0, 0.0], [0.0, 9.0, 0.0]], requires_grad=True)
        names = ("depth", "normal", "face_id", "barycentrics", "effective_faces")
        images, outputs = dpr.render(wall, FACES[:1], views, intrinsics, width=SIZE, height=SIZE, outputs=names)
        self.assertEqual(list(outputs), list(names))
        for i, distance in enumerate((4.0, 4.3)):
            self.assertAlmostEqual(outputs["depth"][i, 8, 8].item(), distance, places=4)
        self.assert_same(outputs["normal"][:, 8, 8], torch.tensor([[0.0, 0.0, 1.0]] * 2), 1e-5)
        self.assertEqual(outputs["face_id"].dtype, torch.int64)
        self.assertEqual(outputs["face_id"][0, 8, 8], 0)
        self.assertAlmostEqual(outputs["barycentrics"][0, 8, 8].sum().item(), 1, places=5)
        self.assertAlmostEqual(outputs["effective_faces"][0, 8, 8].item(), 1, places=5)
        self.assertEqual([name for name in names if outputs[name].requires_grad], ["depth", "normal"])
        images.square().sum().backward()  # after them as without them
        found, wall.grad = wall.grad, None
        dpr.render(wall, FACES[:1], views, intrinsics, width=SIZE, height=SIZE).square().sum().backward()
        self.assert_same(found, wall.grad)
        _, listed = dpr.render([TETRAHEDRON, SQUARE], [FACES, SQUARE_FACES], views, intrinsics, width=SIZE, height=SIZE,
                               outputs=["face_id"])
        self.assertEqual(list(listed["face_id"].shape), [2, SIZE, SIZE])
        with self.assertRaisesRegex(ValueError, "outputs .* got 'shadow', expected depth, position"):
            dpr.render(wall, FACES[:1], views, intrinsics, width=SIZE, height=SIZE, outputs=["shadow"])

    def test_subdivision_for_a_lens(self):
        wall = torch.tensor([[-2.0, -1.6, 2.0], [2.1, -1.5, 1.8], [2.0, 1.6, 1.7], [-2.2, 1.5, 2.1]])
        faces, colors = torch.tensor([[0, 1, 2], [0, 2, 3]]), random(4, 3)
        views, lens = cameras(1)[0], torch.tensor([[45.0, 45.0, 40.0, 30.0, -0.22, 0.03, 0.0, 0.0, 0.0]])
        renderer = dpr.Renderer(80, 60)
        cut = renderer.subdivide(wall, faces, views, lens)
        self.assertGreater(len(cut.faces), 20)
        self.assertEqual(cut.face_of.unique().tolist(), [0, 1])
        self.assertEqual(cut.of_faces(random(2, 3)).shape, cut.faces.shape)

        def image(vertices, colors, tolerance):
            pieces = renderer.subdivide(vertices, faces, views, lens, tolerance=tolerance)
            return renderer(pieces.of_vertices(vertices), pieces.faces, views, lens, colors=pieces.of_vertices(colors))

        finest = image(wall, colors, 0.01)
        error = (image(wall, colors, 0.25) - finest).abs().mean()
        self.assertGreater((renderer(wall, faces, views, lens, colors=colors) - finest).abs().mean(), 20 * error)

        given = [wall.clone().requires_grad_(), colors.clone().requires_grad_()]
        weights = random(1, 60, 80, 4, seed=2)
        (image(*given, 0.25) * weights).sum().backward()
        step = 1e-2
        way = torch.cat([random(4, 3, seed=3), random(4, 3, seed=4)]) - 0.5
        sums = [(image(wall + s * way[:4], colors + s * way[4:], 0.02) * weights).sum() for s in (step, -step)]
        found = sum((tensor.grad * w).sum() for tensor, w in zip(given, (way[:4], way[4:])))
        self.assertAlmostEqual(float((sums[0] - sums[1]) / (2 * step) / found), 1, delta=0.02)

        same = dpr.subdivide(wall, faces, views, lens[:, :4], width=80, height=60)
        self.assertTrue(torch.equal(same.faces, faces))
        self.assertTrue(torch.equal(same.of_vertices(wall), wall))
        for of, rows in ((cut.of_vertices, 5), (cut.of_faces, 3), (cut.of_faces, 1)):
            with self.assertRaisesRegex(ValueError, "values .* expected"):
                of(random(rows, 3))
        for wrong, message in (({"tolerance": -1.0}, "tolerance"), ({"vertices": wall[None]}, "vertices")):
            with self.assertRaisesRegex((RuntimeError, ValueError), message):
                renderer.subdivide(**{"vertices": wall, "faces": faces, "views": views, "intrinsics": lens, **wrong})

    def test_subdivision_of_texture_coordinates(self):
        wall = torch.tensor([[-2.0, -1.6, 2.0], [2.1, -1.5, 1.8], [2.0, 1.6, 1.7], [-2.2, 1.5, 2.1]])
        faces = torch.tensor([[0, 1, 2], [0, 2, 3]])
        views, lens = cameras(1)[0], torch.tensor([[45.0, 45.0, 40.0, 30.0, -0.22, 0.03, 0.0, 0.0, 0.0]])
        renderer = dpr.Renderer(80, 60)
        self.assertIsNone(renderer.subdivide(wall, faces, views, lens).texcoords)

        # An affine function of the place, another one on each face: the seam between them must stay.
        slopes, starts = random(2, 3, 2, seed=5), torch.tensor([[0.0, 0.0], [5.0, -3.0]])
        corners = (torch.einsum("fkc,fcd->fkd", wall[faces], slopes) + starts[:, None]).requires_grad_()
        cut = renderer.subdivide(wall, faces, views, lens, texcoords=corners)
        places, of = cut.of_vertices(wall)[cut.faces], cut.face_of
        expected = torch.einsum("fkc,fcd->fkd", places, slopes[of]) + starts[of][:, None]
        self.assertGreater(len(cut.faces), 20)
        self.assertLess((cut.texcoords - expected).abs().max(), 1e-5)
        cut.texcoords.sum().backward()
        self.assertAlmostEqual(float(corners.grad.sum()), 6.0 * len(cut.faces), delta=1e-2)

        listed = corners.detach().reshape(-1, 2)
        with self.assertRaisesRegex(ValueError, "face_texcoords .*: got indices 0 to 9"):
            renderer.subdivide(wall, faces, views, lens, texcoords=listed,
                               face_texcoords=torch.tensor([[0, 1, 2], [3, 4, 9]]))
        by_index = dpr.subdivide(wall, faces, views, lens, width=80, height=60, texcoords=listed,
                                 face_texcoords=torch.arange(6).view(2, 3))
        self.assertTrue(torch.equal(by_index.texcoords, cut.texcoords))
        of_vertices = random(4, 2, seed=6)
        pieces = renderer.subdivide(wall, faces, views, lens, texcoords=of_vertices)
        self.assertLess((pieces.texcoords - pieces.of_vertices(of_vertices)[pieces.faces]).abs().max(), 1e-6)
        whole = renderer.subdivide(wall, faces, views, lens[:, :4], texcoords=corners)
        self.assertTrue(torch.equal(whole.texcoords, corners))
        renderer(cut.of_vertices(wall), cut.faces, views, lens, texcoords=cut.texcoords, textures=random(4, 4, 3))
        with self.assertRaisesRegex(ValueError, "texcoords .* expected"):
            renderer.subdivide(wall, faces, views, lens, texcoords=random(3, 2))

    def test_another_default_type(self):
        renderer, (views, intrinsics) = dpr.Renderer(SIZE, SIZE), cameras(1)
        expected = renderer(TETRAHEDRON, FACES, views, intrinsics)
        torch.set_default_dtype(torch.float64)
        try:
            self.assertTrue(torch.equal(renderer(TETRAHEDRON, FACES, views, intrinsics), expected))
        finally:
            torch.set_default_dtype(torch.float32)

    def test_gradients_have_the_tensors_types(self):
        renderer, (views, intrinsics) = dpr.Renderer(SIZE, SIZE, **SMOOTH), cameras(1)
        expected = {}
        for kind, tolerance in ((torch.float32, 0), (torch.float64, 0), (torch.float16, 0.03), (torch.bfloat16, 0.2)):
            given = {"vertices": TETRAHEDRON, "views": views, "colors": random(4, 3), "blur": torch.tensor(0.6)}
            given = {name: tensor.to(kind).clone().requires_grad_() for name, tensor in given.items()}
            image = renderer(faces=FACES.to(torch.uint8).tolist(), intrinsics=intrinsics, **given)
            self.assertEqual(image.dtype, torch.float32)
            image.square().sum().backward()
            for name, tensor in given.items():
                self.assertEqual(tensor.grad.dtype, kind)
                scale = expected.setdefault(name, tensor.grad).abs().max()
                self.assertGreater(scale, 0)
                self.assert_same(tensor.grad.float() / scale, expected[name] / scale, tolerance)

    def test_autocast(self):
        renderer, (views, intrinsics) = dpr.Renderer(SIZE, SIZE, **SMOOTH), cameras(1)
        layer = torch.nn.Linear(3, 3, bias=False)
        layer.weight.data = torch.eye(3)
        with torch.autocast("cpu", dtype=torch.bfloat16):
            vertices = layer(TETRAHEDRON)
            self.assertEqual(vertices.dtype, torch.bfloat16)
            image = renderer(vertices, FACES, views, intrinsics)
            loss = image.square().sum()
        loss.backward()
        self.assert_same(image, renderer(vertices.float(), FACES, views, intrinsics))
        self.assertGreater(layer.weight.grad.abs().sum(), 0)

    def test_one_camera_and_many_shapes(self):
        renderer = dpr.Renderer(SIZE, SIZE, **SMOOTH)
        view, intrinsics = (tensor.requires_grad_() for tensor in cameras(1))
        shapes = torch.stack([TETRAHEDRON, 0.8 * TETRAHEDRON])
        image = renderer(shapes, FACES, view, intrinsics)
        self.assert_same(image, renderer(shapes, FACES, view.repeat(2, 1, 1), intrinsics.repeat(2, 1)))
        image.square().sum().backward()
        found, view.grad = view.grad, None
        renderer(shapes, FACES, view.repeat(2, 1, 1), intrinsics.repeat(2, 1)).square().sum().backward()
        self.assertGreater(found.abs().sum(), 0)
        self.assert_same(found, view.grad, 1e-3)
        mixed = renderer(shapes, FACES, view.detach().numpy(), intrinsics.tolist())
        self.assert_same(mixed, image.detach())

    def test_a_mesh_without_faces(self):
        views, intrinsics = cameras(2)
        vertices = [TETRAHEDRON.clone().requires_grad_(), torch.zeros(0, 3, requires_grad=True)]
        image = dpr.render(vertices, [FACES, FACES[:0]], views, intrinsics, width=SIZE, height=SIZE)
        image.square().sum().backward()
        self.assertEqual(image[1].abs().max(), 0)
        self.assertGreater(vertices[0].grad.abs().sum(), 0)
        self.assertEqual(vertices[1].grad.shape, (0, 3))

    def test_a_wanted_gradient_is_never_dropped(self):
        views, intrinsics = cameras(1)
        for name in ("shininess", "znear", "blur_radius", "sigma"):
            with self.assertRaisesRegex(ValueError, f"{name} .* got a tensor that requires a gradient"):
                dpr.Renderer(SIZE, SIZE, **{name: torch.tensor(2.0, requires_grad=True)})
        self.assertEqual(dpr.Renderer(SIZE, SIZE, sigma=torch.tensor(0.5)).settings["sigma"], 0.5)
        vertices = TETRAHEDRON.clone().requires_grad_()
        loss = dpr.render(vertices, FACES, views, intrinsics, width=SIZE, height=SIZE).square().sum()
        (gradient,) = torch.autograd.grad(loss, vertices, create_graph=True)
        with self.assertRaisesRegex(RuntimeError, "no second derivatives"):
            gradient.sum().backward()

    def test_wrong_arguments(self):
        views, intrinsics = cameras(1)
        good = {"vertices": TETRAHEDRON, "faces": FACES, "views": views, "intrinsics": intrinsics, "width": SIZE,
                "height": SIZE}
        expected = dpr.render(**good)
        wrong = [
            (TypeError, "vertices .* got complex64, expected float32", {"vertices": TETRAHEDRON + 0j}),
            (ValueError, r"vertices .* got \[4\], expected \[V, 3\] or \[N, V, 3\]", {"vertices": TETRAHEDRON[:, 0]}),
            (ValueError, "vertices .* got a tensor on meta, expected one on the CPU.* copy=True",
             {"vertices": TETRAHEDRON.to("meta")}),
            (RuntimeError, r"vertices .* got \[3, 4, 3\], expected 1 or 2", {"vertices": TETRAHEDRON.repeat(3, 1, 1),
                                                                           "views": views.repeat(2, 1, 1)}),
            (RuntimeError, "finite", {"vertices": TETRAHEDRON / 0}),
            (TypeError, "faces .* got float32, expected int64", {"faces": FACES.float().requires_grad_()}),
            (ValueError, r"faces .* got \[4, 2\]", {"faces": FACES[:, :2]}),
            (RuntimeError, "faces", {"faces": FACES + 4}),
            (RuntimeError, "faces .* got -1", {"faces": FACES - 1}),
            (ValueError, r"views .* got \[4\], expected \[N, 4, 4\] or", {"views": views[0, 0]}),
            (ValueError, r"intrinsics .* got \[1, 3\], expected \[1, 4\]", {"intrinsics": intrinsics[:, :3]}),
            (ValueError, "colors and face_colors", {"colors": TETRAHEDRON, "face_colors": TETRAHEDRON}),
            (ValueError, r"face_colors .* got \[3, 3\]", {"face_colors": torch.ones(3, 3)}),
            (ValueError, "background", {"background": torch.ones(4)}),
            (ValueError, "lights .* got 'lamp', expected ambient, harmonics", {"lights": {"lamp": torch.ones(3)}}),
            (ValueError, r"lights.spot .* expected \[L, 14\]", {"lights": {"spot": torch.ones(1, 9)}}),
            (TypeError, "lights.point .* got str, expected a tensor", {"lights": {"point": "bright"}}),
            (ValueError, r"lights.point .* got \[\], expected \[L, 9\]", {"lights": {"point": torch.tensor(1.0)}}),
            (ValueError, "sigma", {"sigma": torch.ones(2)}),
            (RuntimeError, "sigma", {"sigma": -1.0}),
            (ValueError, "blur .* got -0.5, expected a number of pixels", {"blur": torch.tensor(-0.5).requires_grad_()}),
            (TypeError, "device .* got 1.5, expected a name", {"device": 1.5}),
            (RuntimeError, "width", {"width": 0}),
            (RuntimeError, "preset", {"preset": "hard"}),
            (RuntimeError, "name .* got \"zfat\", .* did you mean 'zfar'", {"zfat": 3}),
            (ValueError, "name .* got \"backgroud\", .* did you mean 'background'", {"backgroud": torch.ones(3)}),
            (RuntimeError, "cull", {"cull": "both"}),
            (RuntimeError, "zfar", {"znear": 3, "zfar": 2}),
            (RuntimeError, "zfar .* got inf, expected a finite number", {"zfar": float("inf")}),
            (RuntimeError, "no-such-device", {"device": "no-such-device"}),
        ]
        for kind, words, change in wrong:
            with self.subTest(list(change)[0], words=words), self.assertRaisesRegex(kind, words):
                dpr.render(**{**good, **change})
        with self.assertRaises(NotImplementedError):  # of torch: there is nothing to copy
            dpr.render(**{**good, "vertices": TETRAHEDRON.to("meta"), "copy": True})
        self.assert_same(dpr.render(**good, copy=True), expected)
        self.assert_same(dpr.render(**{**good, "device": 0}), dpr.render(**{**good, "device": "0"}))

    def test_no_call_depends_on_the_last_one(self):
        """A kept renderer's views, smoothing and lights need not go with those of the next call."""
        views, intrinsics = cameras(1)
        lights = {"ambient": torch.ones(3), "point": torch.ones(1, 9)}

        def render(znear=1, zfar=10, gamma=5e-2, projection=intrinsics, count=1, **arguments):
            settings = {**SMOOTH, "znear": znear, "zfar": zfar, "gamma": gamma}
            return dpr.render(TETRAHEDRON, FACES, views.repeat(count, 1, 1), projection.repeat(count, 1), width=SIZE,
                              height=SIZE, **arguments, **settings)

        def render_far():
            return render(znear=1e10, zfar=2e10)  # further than lights may be

        def render_near():
            return render(znear=1e-20, zfar=2e-20)  # too short for the next gamma

        def render_orthographic():
            return render(projection=torch.tensor([[3.0]]), lights=lights, count=3)

        def fail():
            with self.assertRaisesRegex(RuntimeError, "znear to zfar .* with lights"):
                render(znear=1e10, zfar=2e10, lights=lights)

        last_calls = [render_far, render_near, render_orthographic, fail]
        calls = [{"lights": lights}, {"gamma": 1e-20}, {"distance": "euclidean", "lights": lights}, {}]
        for arguments in calls:
            dpr.release()
            expected = render(**arguments)
            self.assertGreater(expected[..., 3].sum(), 10)
            for last_call in last_calls:
                with self.subTest(str(arguments), after=last_call.__name__):
                    with warnings.catch_warnings():
                        warnings.simplefilter("ignore")
                        last_call()
                    self.assert_same(render(**arguments), expected)

    def test_strides(self):
        views, intrinsics = cameras(2)
        expected = dpr.render(TETRAHEDRON, FACES, views, intrinsics, width=SIZE, height=SIZE)
        strided = [t.transpose(0, 1).contiguous().transpose(0, 1) for t in (TETRAHEDRON, FACES, views, intrinsics)]
        self.assertFalse(any(t.is_contiguous() for t in strided))
        strided[0].requires_grad_()
        image = dpr.render(*strided, width=SIZE, height=SIZE)
        self.assert_same(image, expected)
        image.transpose(1, 2).square().sum().backward()
        self.assertGreater(strided[0].grad.abs().sum(), 0)

    def test_graphs_in_flight_and_release(self):
        renderer = dpr.Renderer(SIZE, SIZE, **SMOOTH)
        views, intrinsics = cameras(1)

        def gradient():
            vertices = TETRAHEDRON.clone().requires_grad_()
            return vertices, renderer(vertices, FACES, views, intrinsics).square().sum()

        alone, loss = gradient()
        loss.backward()
        flights = [gradient() for _ in range(12)]
        dpr.release()
        for vertices, loss in reversed(flights):
            loss.backward(retain_graph=True)
            loss.backward()
            self.assert_same(vertices.grad, 2 * alone.grad)

    def test_threads(self):
        renderer = dpr.Renderer(SIZE, SIZE, **SMOOTH)
        expected, found = image_of(renderer), []

        def render_some():
            found.extend(image_of(renderer) for _ in range(8))

        threads = [threading.Thread(target=render_some) for _ in range(3)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        self.assertEqual(len(found), 24)
        for image in found:
            self.assert_same(image, expected)

    def test_pickle(self):
        renderer = dpr.Renderer(SIZE, SIZE, **SMOOTH)
        expected = image_of(renderer)
        for other in (pickle.loads(pickle.dumps(renderer)), copy.deepcopy(renderer)):
            self.assertEqual(repr(other), repr(renderer))
            self.assert_same(image_of(other), expected)
        file = io.BytesIO()
        torch.save(renderer, file)

    def test_processes(self):
        renderer = dpr.Renderer(SIZE, SIZE, **SMOOTH)
        expected = image_of(renderer)
        self.assert_same(torch.tensor(in_process("spawn", renderer)), expected)
        self.assertIn("got a fork of one that had opened the device, expected the start method \"spawn\"",
                      in_process("fork", renderer))
        self.assert_same(image_of(renderer), expected)  # here nothing has changed

    def test_workers_of_a_loader(self):
        """Forked before anything is rendered, in a process of their own."""
        run = subprocess.run([sys.executable, __file__, "loader"], capture_output=True, text=True, timeout=300)
        self.assertEqual(run.returncode, 0, run.stderr)

    def test_training(self):
        views, intrinsics = cameras(2)
        renderer = dpr.Renderer(SIZE, SIZE, **SMOOTH)
        colors = random(4, 3)
        target = renderer(TETRAHEDRON, FACES, views, intrinsics, colors=colors)
        vertices = (0.7 * TETRAHEDRON + 0.1).requires_grad_()
        learned = torch.full((4, 3), 0.5, requires_grad=True)
        optimizer = torch.optim.Adam([vertices, learned], lr=0.03)
        losses = []
        for _ in range(80):
            optimizer.zero_grad()
            loss = (renderer(vertices, FACES, views, intrinsics, colors=learned) - target).square().mean()
            loss.backward()
            optimizer.step()
            losses.append(loss.item())
        self.assertLess(losses[-1], 0.1 * losses[0])


class CompiledTest(unittest.TestCase):
    def setUp(self):
        torch._dynamo.reset()

    def check(self, function, *shapes_of_arguments, **options):
        """The same values and gradients, compiled in one graph."""
        compiled = torch.compile(function, fullgraph=True, **options)
        for arguments in shapes_of_arguments:
            results = []
            for call in (function, compiled):
                leaves = [argument.clone().requires_grad_() for argument in arguments]
                loss = call(*leaves)
                loss.backward()
                results.append([loss.detach()] + [leaf.grad for leaf in leaves])
            for found, expected in zip(*results):
                self.assertLessEqual((found - expected).abs().max(), 1e-5 * expected.abs().max())


@unittest.skipIf(RELEASE < (2, 4), "no torch.library.register_fake")
class CompileTest(CompiledTest):
    def test_render(self):
        def loss(vertices, views, intrinsics, sigma):
            image = dpr.render(2 * vertices, FACES, views, intrinsics, width=SIZE, height=SIZE, sigma=sigma, gamma=0.05,
                               preset="joint_gaussian", znear=1, zfar=20)
            return (image - 0.5).square().mean()

        batches = [(TETRAHEDRON / 2, *cameras(count), torch.tensor(5e-3)) for count in (1, 2, 3)]
        self.check(loss, *batches, backend="aot_eager")
        self.check(loss, *batches[:2], backend="inductor")

    def test_renderer_with_lights_and_meshes_that_differ(self):
        renderer = dpr.Renderer(SIZE, SIZE, shading="blinn")
        views, intrinsics = cameras(2)

        def loss(vertices, others, colors, ambient):
            images, outputs = renderer([vertices, others], [FACES, SQUARE_FACES], views, intrinsics,
                                       colors=[colors, others], outputs=["depth"],
                                       lights={"ambient": ambient, "point": torch.ones(1, 9)})
            return (images[..., :3] * outputs["depth"][..., None]).square().mean()

        self.check(loss, (TETRAHEDRON, SQUARE, random(4, 3), torch.ones(3)), backend="aot_eager")

    def test_converted_arguments(self):
        renderer, (views, intrinsics) = dpr.Renderer(SIZE, SIZE, **SMOOTH), cameras(1)
        renderer.blur, listed = 0.5, FACES.tolist()

        def loss(shapes, eye, blur):
            views = dpr.look_at(eye)
            image = renderer(shapes, FACES, views, dpr.perspective(50, SIZE, SIZE), blur=blur) + \
                dpr.Renderer(SIZE, SIZE, blur=1.5)(shapes, listed, views, intrinsics)
            return (image - 0.5).square().mean()

        shapes = torch.stack([TETRAHEDRON, 0.8 * TETRAHEDRON]).double()
        self.check(loss, (shapes, torch.tensor([0.3, 0.2, 4.0]), torch.tensor(0.7)), backend="aot_eager")

    def test_operator(self):
        importlib.import_module("dpr._torch")  # which a first call with tensors does
        views, intrinsics = cameras(2)
        tensors = [TETRAHEDRON.clone().requires_grad_(), FACES, views.requires_grad_(), intrinsics]
        parts = [f"0|{name}|{i}||" for i, name in enumerate(("vertices", "faces", "views", "intrinsics"))]
        spec = "\n".join(["", str(SIZE), str(SIZE), "0", "preset=pixel", "depth", "\t".join(parts)])
        torch.library.opcheck(torch.ops.dpr.render.default, (tensors, [0, 2], spec),
                              test_utils=("test_schema", "test_autograd_registration", "test_faketensor"))


def check_loader():
    renderer = dpr.Renderer(SIZE, SIZE, **SMOOTH)
    loader = torch.utils.data.DataLoader(Images(renderer), batch_size=2, num_workers=2, multiprocessing_context="fork")
    batches = list(loader)
    expected = image_of(renderer)
    for i, batch in enumerate(batches):
        assert (batch[0] - expected[0] - 2 * i).abs().max() < 1e-6
    assert len(batches) == 2


if __name__ == "__main__":
    if sys.argv[1:] == ["loader"]:
        check_loader()
    else:
        unittest.main(verbosity=2)
