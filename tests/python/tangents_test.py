"""Forward mode in the Python package: against the gradients, against differences, and what is refused."""
import sys
import unittest

try:
    import numpy as np
except ImportError:
    print("skipped: no python3-numpy")
    sys.exit(0)
try:
    import torch
    from torch.autograd import forward_ad
except ImportError:
    torch = None
try:
    import scipy.optimize
except ImportError:
    scipy = None
try:
    import jax
except ImportError:
    jax = None

import dpr
from scenes import FACES, SIZE, SMOOTH, SQUARE, SQUARE_FACES, TETRAHEDRON, cameras, random, textured

BARRIER = {**SMOOTH, "preset": "gaussian"}
WEIGHTS = random(2, SIZE, SIZE, 4, seed=3) - 0.5


def inputs():
    """Every array along which images have tangents, of a call with two views; one number is a blur in pixels."""
    views, intrinsics = cameras(2)
    lens = np.concatenate([intrinsics, np.tile(np.float32([0.05, -0.02, 0.01, -0.01, 0.01]), (2, 1))], 1)
    return {"vertices": TETRAHEDRON, "faces": FACES, "views": views, "intrinsics": lens,
            "colors": random(2, 4, 3, seed=5), "background": np.float32([0.1, 0.2, 0.3]), "blur": np.array(0.6, np.float32),
            "gamma": np.array(0.05, np.float32), "alpha": np.array(0.02, np.float32)}


def directions(arrays, count=2):
    """{name: [count, ...]} for the float arrays; views turn, shear and move."""
    found = {name: random(count, *array.shape, seed=i) - 0.5 for i, (name, array) in enumerate(arrays.items())
             if name not in ("faces", "lights")}
    found["views"][:, :, 3] = 0
    return found


def other_inputs():
    """The same of other forms: shapes of their own, colours of faces, orthographic cameras, sigma."""
    views, _ = cameras(2)
    return {"vertices": np.stack([TETRAHEDRON, 0.8 * TETRAHEDRON]), "faces": FACES, "views": views,
            "intrinsics": np.full((2, 1), 3, np.float32), "face_colors": random(4, 3, seed=5), "sigma": np.float32([5e-3])}


class TangentsTest(unittest.TestCase):
    def check_scalar(self, found, expected, scale):
        self.assertGreater(scale, 0)
        self.assertLess(abs(float(found) - float(expected)) / scale, 1e-5)

    def check_transpose(self, tangents, gradients, moved):
        """<u, J v> = <J^T u, v> of one direction a name."""
        for name, tangent in tangents.items():
            with self.subTest(name):
                terms = WEIGHTS.astype(np.float64) * tangent
                by_gradient = (np.asarray(gradients[name], np.float64) * moved[name]).sum()
                self.check_scalar(terms.sum(), by_gradient, np.abs(terms).sum())


class NumpyTest(TangentsTest):
    def check(self, arrays, settings):
        renderer, moved = dpr.Renderer(SIZE, SIZE, **settings), directions(arrays)
        image, pullback = renderer.vjp(**arrays, wrt=list(moved))
        gradients = pullback(WEIGHTS)
        alone = {}
        for name, tangents in moved.items():
            found_image, found = renderer.jvp(**arrays, tangents={name: tangents})
            np.testing.assert_allclose(found_image, image, atol=1e-6)
            self.assertEqual(found.shape, (2, 2, SIZE, SIZE, 4))
            self.assertEqual(found.dtype, np.float32)
            alone[name] = found
        for k in range(2):
            self.check_transpose({name: found[k] for name, found in alone.items()}, gradients,
                                 {name: tangents[k] for name, tangents in moved.items()})
        _, together = renderer.jvp(**arrays, tangents=moved)
        np.testing.assert_allclose(together, sum(alone.values()), rtol=1e-4, atol=1e-4)
        return moved

    def test_transpose_of_gradients(self):
        self.check(inputs(), BARRIER)
        self.check(other_inputs(), SMOOTH)
        pixel = inputs()
        del pixel["blur"], pixel["gamma"], pixel["alpha"]
        self.check({**pixel, "gamma": np.array(0.05, np.float32)},
                   {**SMOOTH, "preset": "pixel", "occupancy_threshold": None})
        one, other = inputs(), cameras(1)
        self.check({**one, "views": other[0], "colors": one["colors"][0]}, BARRIER)  # one camera, of two lenses
        self.check({**inputs(), "lights": {"ambient": np.float32([0.5, 0.4, 0.3]),
                                           "point": textured()["lights"]["point"]}}, BARRIER)

    def test_differences(self):
        step = 5e-4
        for arrays, settings in ((inputs(), BARRIER), (other_inputs(), SMOOTH)):
            moved, renderer = directions(arrays, 1), dpr.Renderer(SIZE, SIZE, **settings)
            moved = {name: tangent * min(1.0, float(np.abs(arrays[name]).max())) for name, tangent in moved.items()}
            ends = [renderer(**{**arrays, **{name: np.float32(arrays[name] + way * step * tangent[0])
                                             for name, tangent in moved.items()}}) for way in (1, -1)]
            _, tangents = renderer.jvp(**arrays, tangents=moved)
            expected = (ends[0] - ends[1]) / (2 * step)
            self.assertLess(np.linalg.norm(tangents[0] - expected), 1e-2 * np.linalg.norm(expected))

    def test_lists_of_meshes(self):
        views, intrinsics = cameras(2)
        renderer, square, black = dpr.Renderer(SIZE, SIZE, **SMOOTH), random(1, 5, 3, seed=2) - 0.5, [0.0, 0.0, 0.0]
        _, both = renderer.jvp([TETRAHEDRON, SQUARE], [FACES, SQUARE_FACES], views, intrinsics, colors=[None, SQUARE],
                               background=black, tangents={"vertices": [None, square], "background": [[0, 0, 1]]})
        _, alone = renderer.jvp(SQUARE, SQUARE_FACES, views[1:], intrinsics[1:], colors=SQUARE,
                                background=black, tangents={"vertices": square, "background": [[0, 0, 1]]})
        image = renderer(TETRAHEDRON, FACES, views[:1], intrinsics[:1])
        np.testing.assert_array_equal(both[:, 1:], alone)
        np.testing.assert_allclose(both[0, 0, ..., 2], 1 - image[0, ..., 3], atol=1e-6)
        self.assertEqual(np.abs(both[0, 0, ..., :2]).max(), 0)

    def test_normal_equations(self):
        arrays = inputs()
        renderer, moved = dpr.Renderer(SIZE, SIZE, **BARRIER), directions(arrays, 3)["vertices"]
        image, tangents = renderer.jvp(**arrays, tangents={"vertices": moved})
        residuals, weights = image - 0.5, random(2, SIZE, SIZE, 1)
        jacobian, rows = tangents.reshape(3, -1).T, np.broadcast_to(weights, image.shape).reshape(-1, 1)
        matrix, vector = dpr.normal_equations(tangents, residuals, weights)
        np.testing.assert_allclose(matrix, jacobian.T @ (rows * jacobian), rtol=1e-4)
        np.testing.assert_allclose(vector, jacobian.T @ (rows[:, 0] * residuals.reshape(-1)), rtol=1e-3)
        np.testing.assert_allclose(dpr.normal_equations(tangents, residuals)[0], jacobian.T @ jacobian, rtol=1e-4)
        np.testing.assert_allclose(dpr.normal_equations([[1, 2]], [3, 4])[1], [11])
        np.testing.assert_allclose(dpr.normal_equations([[1, 2]], [3, 4], [0, 2])[1], [16])
        np.testing.assert_allclose(dpr.normal_equations([[1, 2]], [3, 4], 2)[1], [22])
        for wrong, error in ((residuals[1:], ValueError), (None, TypeError)):
            with self.assertRaisesRegex(error, "tangents .*expected|residuals .*NoneType"):
                dpr.normal_equations(tangents, wrong)
        for wrong in (weights[None], np.ones((3, 1, 1, 1, 1)), weights[:, :3], -weights, weights * np.nan):
            with self.assertRaisesRegex(ValueError, "weights .*got .*(broadcasts|at least 0)"):
                dpr.normal_equations(tangents, residuals, wrong)

    @unittest.skipUnless(torch, "no PyTorch")
    def test_normal_equations_of_tensors_and_arrays(self):
        given = random(3, 4, 5), random(4, 5, seed=2), random(5, seed=3)
        wanted = dpr.normal_equations(*given)
        for kinds in ((1, 1, 1), (0, 1, 0), (1, 0, 0), (0, 0, 1)):
            for of in (torch.float32, torch.float64):
                mixed = [torch.from_numpy(array).to(of) if kind else array for array, kind in zip(given, kinds)]
                for found, expected in zip(dpr.normal_equations(*mixed), wanted):
                    self.assertEqual(found.dtype, of)
                    np.testing.assert_allclose(found, expected, rtol=1e-5)
        found = dpr.normal_equations(*map(torch.from_numpy, given[:2]), given[2].tolist())
        np.testing.assert_allclose(found[0], wanted[0], rtol=1e-5)

    def test_gauss_newton_finds_a_shift(self):
        views, intrinsics = cameras(1)
        renderer, axes = dpr.Renderer(SIZE, SIZE, **SMOOTH), np.eye(3, dtype=np.float32)[:, None].repeat(4, 1)
        target, shift = renderer(TETRAHEDRON, FACES, views, intrinsics), np.float32([0.15, -0.1, 0.2])
        for _ in range(8):
            image, tangents = renderer.jvp(TETRAHEDRON + shift, FACES, views, intrinsics, tangents={"vertices": axes})
            shift = shift - np.linalg.solve(*dpr.normal_equations(tangents, image - target))
        self.assertLess(np.abs(shift).max(), 1e-3)

    @unittest.skipIf(scipy is None, "no scipy")
    def test_scipy_finds_a_shift(self):
        views, intrinsics = cameras(1)
        renderer, axes = dpr.Renderer(SIZE, SIZE, **SMOOTH), np.eye(3)[:, None].repeat(4, 1)
        target = renderer(TETRAHEDRON, FACES, views, intrinsics)

        def shown(shift):
            return renderer.jvp(TETRAHEDRON + shift, FACES, views, intrinsics, tangents={"vertices": axes})

        found = scipy.optimize.least_squares(lambda shift: (shown(shift)[0] - target).ravel(), [0.15, -0.1, 0.2],
                                             jac=lambda shift: shown(shift)[1].reshape(3, -1).T)
        self.assertLess(np.abs(found.x).max(), 1e-3)

    def test_refused(self):
        views, intrinsics = cameras(1)
        mesh, arguments = (SQUARE, SQUARE_FACES, views, intrinsics), textured()
        moved = np.zeros((1, *SQUARE.shape), np.float32)
        lit = {"lights": arguments["lights"]}
        with self.assertRaisesRegex(TypeError, "tangents .*: got ndarray, expected a dictionary"):
            dpr.Renderer(SIZE, SIZE, **SMOOTH).jvp(*mesh, tangents=moved)
        for message, settings, given in (
                (r"tangent of textures\[0\] .* images have none", SMOOTH,
                 {**arguments, "tangents": {"textures": [np.ones((1, 5, 7, 3), np.float32)]}}),
                ("tangent of lights.point .* images have none", SMOOTH,
                 {**lit, "tangents": {"lights": {"point": np.ones((1, 1, 9), np.float32)}}}),
                ("noise on the pixel", {"preset": "pixel"},
                 {"sigma": np.float32([1e-3]), "tangents": {"sigma": np.float32([[1]])}}),
                ("Monte Carlo", {**BARRIER, "aggregation_estimator": "monte_carlo"}, {"tangents": {"vertices": moved}}),
                ("outputs .* 'depth'", SMOOTH, {"outputs": ["depth"], "tangents": {"vertices": moved}}),
                ("tangents .* 'colors', expected names of given arrays", SMOOTH, {"tangents": {"colors": moved}}),
                (r"tangents of vertices .* \[1, 4, 3\], expected \[1, 5, 3\]", SMOOTH,
                 {"tangents": {"vertices": moved[:, :4]}}),
                (r"tangents of vertices .* \[1, 5, 3\], expected \[2, 5, 3\]", SMOOTH,
                 {"tangents": {"vertices": moved, "views": np.zeros((2, 1, 4, 4), np.float32)}}),
                ("tangents of lights .* 'ponit'", SMOOTH, {**lit, "tangents": {"lights": {"ponit": moved}}}),
                ("tangents .* got .faces., expected names of given arrays that are no indices: ", SMOOTH,
                 {"tangents": {"faces": moved}}),
                ("tangent of vertices .* not finite", SMOOTH, {"tangents": {"vertices": moved + np.inf}}),
                ("tangents .* none", SMOOTH, {"tangents": {}})):
            with self.subTest(message), self.assertRaisesRegex(ValueError, message):
                dpr.render_with_jvp(*mesh, width=SIZE, height=SIZE, **settings, **given)


@unittest.skipIf(torch is None, "no torch")
class TorchTest(TangentsTest):
    def setUp(self):
        self.arrays = inputs()
        self.renderer, self.moved = dpr.Renderer(SIZE, SIZE, **BARRIER), directions(self.arrays)
        self.image, self.expected = self.renderer.jvp(**self.arrays, tangents=self.moved)
        self.given = {name: torch.as_tensor(self.arrays[name]) for name in self.moved}
        self.of_direction = [{name: torch.as_tensor(moved[k]) for name, moved in self.moved.items()} for k in range(2)]

    def render(self, given):
        return self.renderer(**{**self.arrays, **given})

    def test_dual_numbers(self):
        with forward_ad.dual_level():
            image = self.render({name: forward_ad.make_dual(tensor, self.of_direction[0][name])
                                 for name, tensor in self.given.items()})
            image, tangent = forward_ad.unpack_dual(image)
        np.testing.assert_allclose(image, self.image, atol=1e-6)
        np.testing.assert_allclose(tangent, self.expected[0], rtol=1e-4, atol=1e-5)
        with forward_ad.dual_level():
            dual = forward_ad.make_dual(self.given["vertices"].double(), self.of_direction[0]["vertices"].double())
            _, tangent = forward_ad.unpack_dual(2 * self.render({"vertices": dual})[..., 3])
            self.assertIsNone(forward_ad.unpack_dual(self.render(self.given)).tangent)
        _, alone = self.renderer.jvp(**self.arrays, tangents={"vertices": self.moved["vertices"]})
        np.testing.assert_allclose(tangent, 2 * alone[0, ..., 3], rtol=1e-4, atol=1e-5)

    def test_refused(self):
        views, intrinsics = cameras(1)
        vertices, ambient = torch.as_tensor(TETRAHEDRON), torch.ones(3)
        with forward_ad.dual_level():
            dual = forward_ad.make_dual(vertices, torch.ones_like(vertices))
            with self.assertRaisesRegex(ValueError, "Monte Carlo"):
                dpr.render(dual, FACES, views, intrinsics, width=SIZE, height=SIZE, preset="paper_cauchy")
            with self.assertRaisesRegex(ValueError, "outputs .* 'depth'"):
                self.renderer(dual, FACES, views, intrinsics, outputs=["depth"])
            if hasattr(torch, "func"):
                image, outputs = self.renderer(dual, FACES, views, intrinsics, outputs=["face_id", "effective_faces"])
                self.assertGreater(forward_ad.unpack_dual(image).tangent.abs().max(), 0)
                self.assertIsNone(forward_ad.unpack_dual(outputs["effective_faces"]).tangent)
            else:
                with self.assertRaisesRegex(ValueError, "outputs .* 'face_id', expected none"):
                    self.renderer(dual, FACES, views, intrinsics, outputs=["face_id"])
            with self.assertRaisesRegex(ValueError, "tangent of lights.ambient"):
                self.renderer(vertices, FACES, views, intrinsics,
                              lights={"ambient": forward_ad.make_dual(ambient, torch.ones(3))})
            vertices.requires_grad_()
            dual = forward_ad.make_dual(vertices, torch.ones_like(vertices))
            tangent = forward_ad.unpack_dual(self.renderer(dual, FACES, views, intrinsics)).tangent
            with self.assertRaisesRegex(RuntimeError, "no second derivatives"):
                tangent.sum().backward()

    @unittest.skipIf(torch is None or not hasattr(torch, "func"), "no torch.func")
    def test_functions(self):
        image, tangent = torch.func.jvp(self.render, (self.given,), (self.of_direction[1],))
        np.testing.assert_allclose(image, self.image, atol=1e-6)
        np.testing.assert_allclose(tangent, self.expected[1], rtol=1e-4, atol=1e-5)
        along = torch.as_tensor(self.moved["vertices"])
        rows = torch.func.vmap(lambda moved: torch.func.jvp(lambda v: self.render({"vertices": v}),
                                                            (self.given["vertices"],), (moved,))[1])(along)
        _, alone = self.renderer.jvp(**self.arrays, tangents={"vertices": self.moved["vertices"]})
        np.testing.assert_allclose(rows, alone, rtol=1e-4, atol=1e-5)
        _, pull = torch.func.vjp(self.render, self.given)
        (gradients,) = pull(torch.as_tensor(WEIGHTS))
        terms = WEIGHTS.astype(np.float64) * self.expected[0]
        by_gradient = sum((gradients[name].double().numpy() * moved[0]).sum() for name, moved in self.moved.items())
        self.check_scalar(terms.sum(), by_gradient, np.abs(terms).sum())

        def brightness(background):
            return self.render({"background": background}).mean((0, 1, 2))

        background = self.given["background"]
        np.testing.assert_allclose(torch.func.jacfwd(brightness)(background), torch.func.jacrev(brightness)(background),
                                   atol=1e-6)
        # Of samples and textures too; torch.autograd has its Jacobians row by row.
        vertices, colors, texels = self.given["vertices"], random(4, 3), torch.as_tensor(random(5, 4, 2))

        def shaded(vertices):
            samples = dpr.rasterize(vertices, FACES, *cameras(1), width=SIZE, height=SIZE)
            image = samples.resolve(samples.interpolate(torch.as_tensor(colors)) + samples.depth[..., None])
            return image.mean((0, 1, 2))

        places = torch.as_tensor(random(1, 2, 2, 2))
        for function, at in ((shaded, vertices), (lambda places: dpr.texture(texels, places), places),
                             (lambda texels: dpr.texture(texels, places), texels)):
            expected = torch.autograd.functional.jacobian(function, at)
            for jacobian in (torch.func.jacrev, torch.func.jacfwd):
                np.testing.assert_allclose(jacobian(function)(at), expected, atol=1e-5 * float(expected.abs().max()))
        batch = torch.func.vmap(lambda places: dpr.texture(texels, places))(torch.stack((places, places / 2)))
        np.testing.assert_array_equal(batch[1], dpr.texture(texels, places / 2))
        for twice in (lambda f: torch.func.jacfwd(torch.func.grad(f)),
                      lambda f: torch.func.grad(lambda b: torch.func.jvp(f, (b,), (b,))[1])):
            with self.assertRaisesRegex((RuntimeError, NotImplementedError), "no second derivatives"):
                twice(lambda b: brightness(b).square().sum())(background)


@unittest.skipIf(jax is None, "no jax")
class JaxTest(TangentsTest):
    def test_functions(self):
        arrays = inputs()
        renderer, moved = dpr.Renderer(SIZE, SIZE, **BARRIER), directions(arrays)
        image, expected = renderer.jvp(**arrays, tangents=moved)
        given = {name: jax.numpy.asarray(arrays[name]) for name in moved}
        first = {name: jax.numpy.asarray(tangent[0]) for name, tangent in moved.items()}

        def render(given):
            return renderer(**{**arrays, **given})

        for jvp in (lambda given, along: jax.jvp(render, (given,), (along,)), jax.jit(lambda given, along: jax.jvp(
                render, (given,), (along,)))):
            found, tangent = jvp(given, first)
            np.testing.assert_allclose(found, image, atol=1e-6)
            np.testing.assert_allclose(tangent, expected[0], rtol=1e-4, atol=1e-5)
        _, push = jax.linearize(render, given)
        np.testing.assert_allclose(push(first), expected[0], rtol=1e-4, atol=1e-5)
        np.testing.assert_allclose(jax.vmap(push)(moved), expected, rtol=1e-4, atol=1e-5)
        (transposed,) = jax.linear_transpose(push, given)(WEIGHTS)
        (gradients,) = jax.vjp(render, given)[1](WEIGHTS)
        for name, gradient in gradients.items():
            np.testing.assert_allclose(transposed[name], gradient, rtol=1e-5, atol=1e-6)
        _, pullback = renderer.vjp(**arrays, wrt=list(moved))
        for name, gradient in pullback(WEIGHTS).items():
            np.testing.assert_allclose(gradients[name], gradient, rtol=1e-4, atol=1e-5)
        terms = WEIGHTS.astype(np.float64) * expected[0]
        by_gradient = sum((np.asarray(gradients[name], np.float64) * tangent[0]).sum() for name, tangent in moved.items())
        self.check_scalar(terms.sum(), by_gradient, np.abs(terms).sum())

    def test_batches(self):
        views, intrinsics = cameras(1)
        renderer = dpr.Renderer(SIZE, SIZE, **SMOOTH)

        def brightness(offset):
            return renderer(jax.numpy.asarray(TETRAHEDRON) + offset, FACES, views, intrinsics).mean((0, 1, 2))

        offset = jax.numpy.zeros(3)
        np.testing.assert_allclose(jax.jacfwd(brightness)(offset), jax.jacrev(brightness)(offset), atol=1e-6)
        offsets = jax.numpy.asarray([[0, 0, 0], [0.1, 0, 0.2]])
        for each, expected in zip(jax.vmap(jax.jacfwd(brightness))(offsets), offsets):
            np.testing.assert_allclose(each, jax.jacrev(brightness)(expected), atol=1e-6)

    def test_refused(self):
        views, intrinsics = cameras(1)
        renderer, vertices = dpr.Renderer(SIZE, SIZE, **SMOOTH), jax.numpy.asarray(TETRAHEDRON)
        along = (jax.numpy.ones_like(vertices),)
        with self.assertRaisesRegex(Exception, "outputs .* 'depth'"):
            jax.jvp(lambda v: renderer(v, FACES, views, intrinsics, outputs=["depth"])[0], (vertices,), along)
        _, (outputs, tangents) = jax.jvp(lambda v: renderer(v, FACES, views, intrinsics, outputs=["face_id"]),
                                         (vertices,), along)
        self.assertEqual(tangents["face_id"].dtype, jax.dtypes.float0)
        with self.assertRaisesRegex(Exception, "tangent of lights.ambient"):
            jax.jvp(lambda a: renderer(vertices, FACES, views, intrinsics, lights={"ambient": a}),
                    (jax.numpy.ones(3),), (jax.numpy.ones(3),))
        with self.assertRaisesRegex(Exception, "Monte Carlo"):
            jax.jvp(lambda v: dpr.render(v, FACES, views, intrinsics, width=SIZE, height=SIZE, preset="paper_cauchy"),
                    (vertices,), along)
        with self.assertRaisesRegex(NotImplementedError, "no second derivatives"):
            jax.jvp(lambda v: jax.jvp(lambda v: renderer(v, FACES, views, intrinsics), (v,), along)[1], (vertices,), along)


if __name__ == "__main__":
    unittest.main(verbosity=2)
