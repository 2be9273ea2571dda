"""Textures for shading of the caller's own: the library's own image by samples and texture(), and derivatives of every kind
of arrays."""
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

import dpr

RANDOM = np.random.default_rng(3)
SIZE = 32


def drawn(*shape, low=0.0, high=1.0):
    return (low + (high - low) * RANDOM.random(shape)).astype(np.float32)


def error(found, wanted):
    return np.abs(np.asarray(found) - np.asarray(wanted)).max() / np.abs(np.asarray(wanted)).max()


class TextureMapsTest(unittest.TestCase):
    def setUp(self):
        self.faces = np.array([[0, 1, 2], [2, 1, 3]])
        self.vertices = np.array([[-1, -1, 0], [1, -1, 0.4], [-1, 1, -0.4], [1, 1, 0]], np.float32)
        self.texcoords = np.array([[-0.3, 0.1], [1.7, 0.0], [0.1, 1.4], [1.5, 1.2]], np.float32)
        self.texels = drawn(6, 5, 3)
        self.cameras = dpr.look_at([[0, 0, 4], [1, 1, 3]]), dpr.perspective(40, SIZE, SIZE)

    def test_the_librarys_own_image(self):
        arguments = self.vertices, self.faces, *self.cameras
        of_texture = {"texcoords": self.texcoords, "textures": [self.texels], "wrap": "mirror"}
        image, own = dpr.render_with_vjp(*arguments, width=SIZE, height=SIZE, **of_texture, wrt=["textures", "texcoords"])
        samples = dpr.rasterize(*arguments, width=SIZE, height=SIZE)
        uv = samples.interpolate(self.texcoords)
        values, of_texels = dpr.texture_with_vjp(self.texels, uv, wrap="mirror")
        self.assertTrue((values == dpr.texture(self.texels, uv, wrap="mirror")).all())
        found, resolved = samples.resolve_with_vjp(np.where(samples.mask[..., None], values, 0))
        self.assertLess(error(found, image[..., :3]), 1e-5)
        weights = drawn(*found.shape, low=-1)
        wanted = own(np.concatenate([weights, np.zeros_like(weights[..., :1])], -1))
        grad = of_texels(resolved(weights)[0] * samples.mask[..., None])
        self.assertLess(error(grad["texels"], wanted["textures"][0]), 1e-4)
        corners = samples.barycentrics[..., None] * grad["texcoords"][..., None, :]  # [N, h, w, 3, 2]
        by_vertex = np.zeros_like(self.texcoords)
        np.add.at(by_vertex, self.faces[samples.face_id.clip(0)], corners)
        self.assertLess(error(by_vertex, wanted["texcoords"]), 1e-4)

    def test_steps_to_the_next_sample(self):
        samples = dpr.rasterize(self.vertices, self.faces, *self.cameras, width=SIZE, height=SIZE, supersampling=2)
        uv, steps = samples.interpolate(self.texcoords), samples.interpolate_steps(self.texcoords)
        self.assertEqual(steps.shape, (*uv.shape, 2))
        inner = samples.face_id[:, 1:-1, 1:-1]
        for axis in (0, 1):  # to the right, down
            behind, ahead = ((slice(None), *(slice(1 + way, way - 1 or None) if of == 1 - axis else slice(1, -1)
                                             for of in (0, 1))) for way in (-1, 1))
            is_inside = (inner >= 0) & (samples.face_id[behind] == inner) & (samples.face_id[ahead] == inner)
            self.assertGreater(is_inside.sum(), 500)
            change = 0.5 * (uv[ahead] - uv[behind])[is_inside]
            self.assertLess(error(steps[:, 1:-1, 1:-1, :, axis][is_inside], change), 1e-2)
        # The further apart samples are, the smaller is the version of the texture that they read.
        fine = dpr.texture(drawn(256, 256, 1), 0.05 * uv, steps=0.05 * steps, filter="trilinear")
        coarse = dpr.texture(drawn(256, 256, 1), 50 * uv, steps=50 * steps, filter="trilinear")
        self.assertGreater(np.std(fine[samples.mask]), 0.1)
        self.assertLess(np.std(coarse[samples.mask]), 0.02)

    def test_faces_of_other_arrays(self):
        """Two views, and attributes by indices of their own."""
        at, faces = drawn(5, 6), np.array([[4, 1, 2], [3, 0, 1]], np.int32)
        samples = dpr.rasterize(self.vertices, self.faces, *self.cameras, width=SIZE, height=SIZE)
        wanted = samples.interpolate(at, faces), samples.interpolate_steps(at, faces)
        self.assertGreater(np.abs(wanted[1]).max(), 0)
        self.assertEqual(samples.interpolate(drawn(4, 0)).shape[-1], 0)
        if torch is None:
            return
        vertices = torch.tensor(self.vertices, requires_grad=True)
        samples = dpr.rasterize(vertices, self.faces, *self.cameras, width=SIZE, height=SIZE)
        for own in (faces, faces.tolist(), torch.from_numpy(faces)):
            for found, values in zip((samples.interpolate(at, own), samples.interpolate_steps(at, own)), wanted):
                self.assertLess(error(found.detach(), values), 1e-5)
        # A derivative that has one itself.
        table = torch.tensor(at, requires_grad=True)
        sum_of_squares = samples.interpolate(table, faces).square().sum()
        (first,) = torch.autograd.grad(sum_of_squares, table, create_graph=True)
        (second,) = torch.autograd.grad(first.sum(), table)
        ones = samples.interpolate(torch.ones_like(table), faces)
        samples.interpolate(table, faces).backward(2 * ones)
        self.assertLess(error(second, table.grad), 1e-5)

    def test_gradients_of_every_array(self):
        for cube in (False, True):
            texels = drawn(6, 8, 8, 2) if cube else drawn(7, 9, 2)
            uv = drawn(2, 5, 6, 3 if cube else 2, low=-1)
            steps, levels = drawn(*uv.shape, 2, low=-0.1, high=0.1), drawn(2, 5, 6)
            given = {"texels": texels, "texcoords": uv, "steps": steps, "levels": levels}
            values, pullback = dpr.texture_with_vjp(**given, filter="trilinear")
            weights = drawn(*values.shape, low=-1)
            gradients = pullback(weights)
            for name, array in given.items():
                self.assertEqual(gradients[name].shape, array.shape)
            if torch is None:
                continue
            tensors = {name: torch.tensor(array, requires_grad=True) for name, array in given.items()}
            found = dpr.texture(**tensors, filter="trilinear")
            self.assertTrue((found.detach().numpy() == values).all())
            found.backward(torch.from_numpy(weights))
            for name, tensor in tensors.items():
                self.assertTrue((tensor.grad.numpy() == gradients[name]).all(), name)
            moves = {name: drawn(*array.shape, low=-1) for name, array in given.items()}
            with forward_ad.dual_level():
                moving = {name: forward_ad.make_dual(torch.from_numpy(array), torch.from_numpy(moves[name]))
                          for name, array in given.items()}
                tangent = forward_ad.unpack_dual(dpr.texture(**moving, filter="trilinear")).tangent.numpy()
            backward = sum((gradients[name] * moves[name]).sum(dtype=float) for name in given)
            forward = (tangent * weights).sum(dtype=float)
            self.assertLess(abs(forward - backward), 1e-5 * np.abs(tangent * weights).sum())

    def test_wrong_arguments(self):
        uv = drawn(1, 2, 3, 2)
        for message, call in (
                (r"texcoords \(dpr.texture\): got \[2, 3, 2\]", lambda: dpr.texture(self.texels, uv[0])),
                (r"texels \(dpr.texture\): got \[5, 3\]", lambda: dpr.texture(self.texels[0], uv)),
                (r"steps \(dpr.texture\): got \[1, 2, 3, 4\], expected \[N, h, w, 2, 2\]",
                 lambda: dpr.texture(self.texels, uv, steps=drawn(1, 2, 3, 4))),
                (r"levels \(dpr.texture\)", lambda: dpr.texture(self.texels, uv, levels=drawn(1, 2, 2))),
                ("expected repeat, mirror, clamp or zero", lambda: dpr.texture(self.texels, uv, wrap="round")),
                ("expected nearest, bilinear, trilinear or mipmap", lambda: dpr.texture(self.texels, uv, filter="cubic")),
                (r"texels\[0\] \(dpr.texture\): got \[3, 4, 4, 2\]", lambda: dpr.texture(drawn(3, 4, 4, 2), uv)),
                (r"texcoords \(dpr.texture\): got nan", lambda: dpr.texture(self.texels, uv * np.nan))):
            with self.assertRaisesRegex(ValueError, message):
                call()
        for name, arguments, words in (("texels", ("texels", uv), {}), ("texels", (None, uv), {}),
                                       ("texcoords", (self.texels, None), {}), ("wrap", (self.texels, uv), {"wrap": None})):
            with self.assertRaisesRegex(TypeError, name):
                dpr.texture(*arguments, **words)
        with self.assertRaisesRegex(ValueError, "values .*got nan"):
            dpr.texture_with_vjp(self.texels, uv)[1](np.full((1, 2, 3, 3), np.nan))
        with self.assertRaisesRegex(ValueError, "expected repeat"):
            dpr.texture(drawn(6, 4, 4, 2), drawn(1, 2, 3, 3), wrap="round")


if __name__ == "__main__":
    unittest.main()
