"""The Python package `dpr` with JAX."""
import sys
import unittest

try:
    import jax
    import jax.numpy as jnp
    import numpy as np
except ImportError:
    print("skipped: no jax")
    sys.exit(0)

import dpr
from scenes import FACES, SIZE, SMOOTH, SQUARE, SQUARE_FACES, TETRAHEDRON, cameras, random, textured


class JaxTest(unittest.TestCase):
    def test_is_what_numpy_has(self):
        views, intrinsics = cameras(2)
        renderer, arguments = dpr.Renderer(SIZE, SIZE, **SMOOTH), textured()
        weights = random(2, SIZE, SIZE, 4, seed=3) - 0.5
        (image, outputs), pullback = renderer.vjp(SQUARE, SQUARE_FACES, views, intrinsics, **arguments,
                                                  outputs=["depth", "face_id"])
        expected = pullback(weights, depth=weights[..., 0])

        def loss(vertices, textures, lights, views):
            image, outputs = renderer(vertices, SQUARE_FACES, views, intrinsics, outputs=["depth", "face_id"],
                                      **{**arguments, "textures": textures, "lights": lights})
            seen = (image * weights).sum() + (outputs["depth"] * weights[..., 0]).sum()
            return seen, (image, outputs)

        given = (jnp.asarray(SQUARE), [jnp.asarray(t) for t in arguments["textures"]],
                 {name: jnp.asarray(light) for name, light in arguments["lights"].items()}, jnp.asarray(views))
        for transformed in (jax.value_and_grad, lambda *a, **k: jax.jit(jax.value_and_grad(*a, **k))):
            (_, (found, its_outputs)), gradients = transformed(loss, argnums=(0, 1, 2, 3), has_aux=True)(*given)
            np.testing.assert_array_equal(found, image)
            np.testing.assert_array_equal(its_outputs["face_id"], outputs["face_id"])
            for ours, theirs in [(gradients[0], expected["vertices"]), (gradients[1][0], expected["textures"][0]),
                                 (gradients[2]["point"], expected["lights"]["point"]), (gradients[3], expected["views"])]:
                self.assertGreater(np.abs(theirs).sum(), 0)
                np.testing.assert_allclose(ours, theirs, rtol=1e-4, atol=1e-5)

    def test_own_shading(self):
        """The library's own colours, found by the caller: its images and gradients."""
        views, intrinsics = cameras(2)
        renderer, colors, background = dpr.Renderer(SIZE, SIZE, blur=0.6, gamma=1e-7), random(4, 3, seed=5), [0.1, 0.2, 0.3]
        weights = random(2, SIZE, SIZE, 4, seed=3) - 0.5
        image, pullback = renderer.vjp(TETRAHEDRON, FACES, views, intrinsics, colors=colors, background=background)
        expected = pullback(weights)

        def loss(vertices, colors, views, intrinsics):
            samples = renderer.rasterize(vertices, FACES, views, intrinsics)
            mask = samples.mask[..., None]
            shown = jnp.where(mask, samples.interpolate(colors), jnp.asarray(background))
            found = samples.resolve(jnp.concatenate([shown, mask.astype(jnp.float32)], -1))
            return (found * weights).sum(), found

        given = tuple(map(jnp.asarray, (TETRAHEDRON, colors, views, intrinsics)))
        for transformed in (jax.value_and_grad, lambda *a, **k: jax.jit(jax.value_and_grad(*a, **k))):
            (_, found), gradients = transformed(loss, argnums=(0, 1, 2, 3), has_aux=True)(*given)
            np.testing.assert_allclose(found, image, atol=1e-5)
            for gradient, name in zip(gradients, ("vertices", "colors", "views", "intrinsics")):
                scale = np.abs(expected[name]).max()
                self.assertGreater(scale, 0)
                wanted = expected[name]
                if name == "views":  # those of affine matrices are the library's, of rigid motions the samples'
                    continue
                np.testing.assert_allclose(gradient / scale, wanted / scale, atol=1e-4, err_msg=name)

        def black(covered, vertices, colors):
            samples = renderer.rasterize(vertices, FACES, views, intrinsics)
            return (samples.resolve(samples.interpolate(colors, covered=covered)) * weights[..., :3]).sum()

        (value, gradients), wanted = (jax.value_and_grad(black, argnums=(1, 2))(covered, *given[:2]) for covered in (True, False))
        self.assertAlmostEqual(float(value), float(wanted[0]), 4)
        for gradient, of_all in zip(gradients, wanted[1]):
            np.testing.assert_allclose(gradient, of_all, atol=1e-5 * float(np.abs(of_all).max()))

        def depths(vertices):
            samples = renderer.rasterize(vertices, FACES, views, intrinsics, layers=2)
            return sum((layer.depth * layer.mask).sum() for layer in samples.layers)

        direction = random(4, 3, seed=8) - 0.5
        found = (jax.grad(depths)(given[0]) * direction).sum()
        samples = renderer.rasterize(TETRAHEDRON, FACES, views, intrinsics, layers=2)
        by_hand = sum(layer.pullback(depth=layer.mask.astype(np.float32))["vertices"] for layer in samples.layers)
        self.assertAlmostEqual(float(found) / float((by_hand * direction).sum()), 1, delta=1e-4)
        traced = renderer.rasterize(given[0], FACES, views, intrinsics)
        for refused in (lambda: traced.resolve(np.zeros((2, 3, 3, 1), np.float32)),
                        lambda: traced.jvp({"vertices": direction}),
                        lambda: dpr.Renderer(SIZE, SIZE, **SMOOTH).rasterize(given[0], FACES, views, intrinsics)):
            with self.assertRaises((ValueError, TypeError)):
                refused()

    def test_own_shading_in_forward_mode(self):
        """<u, J v> = <J^T u, v> for each argument, along one direction and several, under jit too."""
        views, intrinsics = cameras(2)
        renderer, colors = dpr.Renderer(SIZE, SIZE, blur=0.6), random(4, 3, seed=5)
        size = renderer.rasterize(TETRAHEDRON, FACES, views, intrinsics).face_id.shape
        given = dict(vertices=TETRAHEDRON, views=views, intrinsics=intrinsics, colors=colors, values=random(*size, 4, seed=6))
        given = {name: jnp.asarray(array) for name, array in given.items()}
        ways = {name: random(3, *array.shape, seed=i) - 0.5 for i, (name, array) in enumerate(given.items(), 7)}
        weights = random(2, SIZE, SIZE, 4, seed=3) - 0.5

        def image_of(given):
            front, back = renderer.rasterize(given["vertices"], FACES, given["views"], given["intrinsics"], layers=2).layers
            shown = jnp.concatenate([front.interpolate(given["colors"]), (back.depth - front.depth)[..., None]], -1)
            return front.resolve(shown + given["values"])

        def check(tangent, expected):
            terms = np.asarray(tangent, np.float64) * weights
            self.assertGreater(np.abs(expected), 1e-4 * np.abs(terms).sum())
            self.assertLess(np.abs(terms.sum() - expected), 1e-5 * np.abs(terms).sum())

        image, pull = jax.vjp(image_of, given)
        gradients, = jax.jit(pull)(jnp.asarray(weights))
        by_gradients = {name: (np.asarray(gradients[name], np.float64) * ways[name]).reshape(3, -1).sum(1) for name in given}

        def push(function, value):
            return jax.jvp(function, (value,), (1.0,))

        def linearized(function, value):
            found, tangent_of = jax.linearize(function, value)
            return found, tangent_of(1.0)
        for name, array in given.items():
            def along(amount):
                return image_of({**given, name: array + amount * ways[name][0]})
            for found, tangent in (push(along, 0.0), jax.jit(lambda: push(along, 0.0))(), linearized(along, 0.0)):
                np.testing.assert_allclose(found, image, atol=1e-6)
                check(tangent, by_gradients[name][0])

        def along_all(amounts):
            return image_of({name: array + jnp.tensordot(amounts, ways[name], 1) for name, array in given.items()})
        for jacobian_of in (jax.jacfwd(along_all), jax.jit(jax.jacfwd(along_all))):
            jacobian = jacobian_of(np.zeros(3, np.float32))
            self.assertEqual(jacobian.shape, (2, SIZE, SIZE, 4, 3))
            for k, expected in enumerate(sum(by_gradients.values())):
                check(jacobian[..., k], expected)
        backward = jax.jacrev(along_all)(np.zeros(3, np.float32))
        np.testing.assert_allclose(backward, jacobian, atol=1e-4 * np.abs(jacobian).max())

        def of_scale(scale):  # shapes that are a batch of JAX's are rasterized one after the other
            return image_of({**given, "vertices": scale * TETRAHEDRON})
        scales = np.float32([1, 0.9])
        _, batch = jax.vmap(lambda scale: push(of_scale, scale))(scales)
        for scale, tangent in zip(scales, batch):
            np.testing.assert_allclose(tangent, push(of_scale, scale)[1], atol=1e-5)
        for second in (jax.jacfwd(jax.jacfwd(along_all)), jax.hessian(lambda amounts: along_all(amounts).sum())):
            with self.assertRaisesRegex(NotImplementedError, "no second derivatives"):
                second(np.zeros(3, np.float32))

    def test_own_shading_of_lists_of_meshes(self):
        views, intrinsics = cameras(2)
        renderer, faces, weights = dpr.Renderer(SIZE, SIZE, blur=0.6), [FACES, SQUARE_FACES], random(2, SIZE, SIZE, 3) - 0.5
        meshes, colors = [TETRAHEDRON, SQUARE], [random(4, 3, seed=2), random(5, 3, seed=3)]

        def seen(vertices, colors, faces=faces, rows=slice(None)):
            samples = renderer.rasterize(vertices, faces, views[rows], intrinsics[rows])
            return (samples.resolve(samples.interpolate(colors)) * weights[rows]).sum()

        given = jax.tree_util.tree_map(jnp.asarray, (meshes, colors))
        way = jax.tree_util.tree_map(lambda array: random(*array.shape, seed=8) - 0.5, given)
        gradients = jax.jit(jax.grad(seen, argnums=(0, 1)))(*given)
        total = sum((np.asarray(gradient, np.float64) * step).sum()
                    for gradient, step in zip(*map(jax.tree_util.tree_leaves, (gradients, way))))
        _, tangent = jax.jit(lambda: jax.jvp(seen, given, way))()
        self.assertAlmostEqual(float(tangent) / total, 1, delta=1e-4)
        for i in range(2):
            alone = jax.grad(seen, argnums=(0, 1))(given[0][i], given[1][i], faces[i], slice(i, i + 1))
            for found, expected in zip((gradients[0][i], gradients[1][i]), alone):
                self.assertGreater(np.abs(expected).max(), 0)
                np.testing.assert_allclose(found, expected, atol=1e-5 * np.abs(expected).max())

    def test_converted_arguments(self):
        views, intrinsics = cameras(1)
        renderer, shapes = dpr.Renderer(SIZE, SIZE, **SMOOTH), np.stack([TETRAHEDRON, 0.8 * TETRAHEDRON])
        _, pullback = renderer.vjp(shapes, FACES, views, intrinsics, blur=np.float32(0.6).reshape(1))
        weights = random(2, SIZE, SIZE, 4)
        expected = pullback(weights)

        def loss(shapes, views, blur):
            return (renderer(shapes, jnp.asarray(FACES, jnp.uint8), views, intrinsics.tolist(), blur=blur) * weights).sum()

        for kind, tolerance in ((jnp.float32, 1e-4), (jnp.bfloat16, 0.05)):
            given = [jnp.asarray(array, kind) for array in (shapes, views, 0.6)]
            for found, name in zip(jax.jit(jax.grad(loss, argnums=(0, 1, 2)))(*given), ("vertices", "views", "blur")):
                self.assertEqual(found.dtype, kind)
                scale = np.abs(expected[name]).max()
                self.assertGreater(scale, 0)
                np.testing.assert_allclose(np.asarray(found, np.float32).reshape(expected[name].shape) / scale,
                                           expected[name] / scale, atol=tolerance)
        two = cameras(2)
        found = jax.grad(lambda v: renderer([v, v[:0]], [FACES, FACES[:0]], *two).sum())(jnp.asarray(TETRAHEDRON))
        alone = jax.grad(lambda v: renderer(v, FACES, *cameras(1)).sum())(jnp.asarray(TETRAHEDRON))
        np.testing.assert_array_equal(found, alone)

    def test_training(self):
        views, intrinsics = cameras(2)
        renderer = dpr.Renderer(SIZE, SIZE, **SMOOTH)
        target = renderer(jnp.asarray(TETRAHEDRON), FACES, views, intrinsics)
        step = jax.jit(jax.value_and_grad(
            lambda v, sigma: ((renderer(v, FACES, views, intrinsics, sigma=sigma) - target) ** 2).mean()))
        vertices, losses = 0.7 * TETRAHEDRON + 0.1, []
        for _ in range(60):
            loss, gradient = step(vertices, jnp.float32(5e-3))
            vertices = vertices - 0.02 * gradient / (jnp.abs(gradient).max() + 1e-9)
            losses.append(float(loss))
        self.assertLess(min(losses), 0.2 * losses[0])

    def test_losses_of_shapes(self):
        """Values are NumPy's, and gradients those of differences, traced by jit too."""
        losses, step = dpr.MeshLoss(SQUARE_FACES), random(5, 3, seed=2) - 0.5
        terms = [losses.laplacian, losses.edge_length, losses.normal_consistency, losses.flatness,
                 lambda vertices: dpr.chamfer(dpr.sample_points(vertices, SQUARE_FACES, 40, seed=1), TETRAHEDRON)]
        for term in terms:
            np.testing.assert_allclose(term(jnp.asarray(SQUARE)), term(SQUARE), rtol=1e-5)
            gradient = jax.jit(jax.grad(term))(jnp.asarray(SQUARE))
            change = (term(SQUARE + 1e-3 * step) - term(SQUARE - 1e-3 * step)) / 2e-3
            np.testing.assert_allclose((gradient * step).sum(), change, rtol=1e-2, atol=1e-3)

    def test_two_faces_without_area_at_one_edge(self):
        """Have no part in the gradients, which are those of the other faces alone."""
        vertices = jnp.asarray([[0, 0, 0], [0, 0, 0], [1, 0, 0], [-1, 1, 0], [0, 2, 0], [2, 2, 1]], float)
        losses, alone = dpr.MeshLoss([[0, 1, 2], [1, 0, 3], [3, 2, 4], [4, 2, 5]]), dpr.MeshLoss([[3, 2, 4], [4, 2, 5]])
        for name in ("normal_consistency", "flatness"):
            found, wanted = (jax.grad(getattr(loss, name))(vertices) for loss in (losses, alone))
            np.testing.assert_allclose(len(losses._hinges) * found, wanted, rtol=1e-5, atol=1e-6)

    def test_losses_of_images(self):
        """Of arrays, lists and NumPy's arrays alike, and traced by jit."""
        image, target = (random(1, 14, 15, 4, seed=seed) for seed in (1, 2))
        step = image - target  # along which no difference changes its sign
        for kind in ("mse", "l1", "silhouette", "robust", "ssim"):
            def loss(image):
                return dpr.image_loss(image, target, mask=np.ones((14, 15, 1), np.float32), **{kind: 1})
            np.testing.assert_allclose(loss(jnp.asarray(image)), loss(image), rtol=1e-4)
            gradient = jax.jit(jax.grad(loss))(jnp.asarray(image))
            change = (loss(image + 1e-2 * step) - loss(image - 1e-2 * step)) / 2e-2
            np.testing.assert_allclose((gradient * step).sum(), change, rtol=2e-2, atol=1e-4)
        np.testing.assert_allclose(dpr.image_loss(image, jnp.asarray(target), mse=1), dpr.image_loss(image, target, mse=1),
                                   rtol=1e-5)

    def test_wrong_arguments(self):
        views, intrinsics = cameras(1)
        with self.assertRaisesRegex(TypeError, "vertices .* got int32, expected float32"):
            dpr.render(jnp.zeros((4, 3), int), FACES, views, intrinsics, width=SIZE, height=SIZE)
        with self.assertRaisesRegex(Exception, "expected .*V, 3"):
            dpr.render(jnp.asarray(TETRAHEDRON)[:, 0], FACES, views, intrinsics, width=SIZE, height=SIZE)
        with self.assertRaisesRegex(Exception, r"\(dpr.rasterize\).* expected .*V, 3"):
            dpr.rasterize(jnp.asarray(TETRAHEDRON)[:, 0], FACES, views, intrinsics, width=SIZE, height=SIZE)

    def test_textures(self):
        random = np.random.default_rng(3)
        texels, uv = random.random((6, 5, 2), np.float32), 3 * random.random((2, 4, 5, 2), np.float32) - 1
        values, pullback = dpr.texture_with_vjp(texels, uv, wrap="mirror")
        weights, moves = random.random(values.shape, np.float32), [random.random(a.shape, np.float32) for a in (texels, uv)]
        wanted = pullback(weights)

        def loss(texels, uv):
            return (dpr.texture(texels, uv, wrap="mirror") * weights).sum()

        found = jax.jit(jax.grad(loss, (0, 1)))(texels, uv)
        for gradient, name in zip(found, ("texels", "texcoords")):
            np.testing.assert_allclose(gradient, wanted[name], atol=1e-5)
        tangent = jax.jvp(loss, (jax.numpy.asarray(texels), jax.numpy.asarray(uv)), tuple(moves))[1]
        backward = sum((wanted[name] * move).sum() for name, move in zip(("texels", "texcoords"), moves))
        self.assertLess(abs(tangent - backward), 1e-4 * abs(backward))


if __name__ == "__main__":
    unittest.main(verbosity=2)
