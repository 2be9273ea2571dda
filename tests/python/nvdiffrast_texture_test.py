"""Textures of dpr.nvdiffrast against texels that are picked by hand, and derivatives against differences."""
import sys
import unittest

try:
    import numpy as np
    import torch
except ImportError:
    print("skipped: no python3-numpy or python3-torch")
    sys.exit(0)

import dpr.nvdiffrast as dr
import tensors
from tensors import differences, random

H, W = 8, 16
# Directions at (s, t) on the faces of a cube, as OpenGL's table of cube maps has them, for 2 s - 1 and 2 t - 1.
OF_FACES = (lambda s, t: (1, -t, -s), lambda s, t: (-1, -t, s), lambda s, t: (s, 1, t), lambda s, t: (s, -1, -t),
            lambda s, t: (s, -t, 1), lambda s, t: (-s, -t, -1))


def texel(tex, column, row, boundary):
    height, width = tex.shape[:2]
    if boundary == "wrap":
        return tex[row % height, column % width]
    if boundary == "zero" and not (0 <= row < height and 0 <= column < width):
        return np.zeros(tex.shape[-1])
    return tex[min(max(row, 0), height - 1), min(max(column, 0), width - 1)]


def by_hand(tex, uv, boundary, is_nearest=False):
    """Of one image [H, W, C] and coordinates [..., 2]."""
    tex, found = tex.double().numpy(), []
    for u, v in uv.double().numpy().reshape(-1, 2):
        if boundary == "clamp":
            u, v = min(max(u, 0), 1), min(max(v, 0), 1)
        x, y = u * tex.shape[1], v * tex.shape[0]
        if is_nearest:
            found.append(texel(tex, int(np.floor(x)), int(np.floor(y)), boundary))
            continue
        x, y = x - 0.5, y - 0.5
        column, row = int(np.floor(x)), int(np.floor(y))
        found.append(sum(texel(tex, column + i, row + j, boundary) * (x - column if i else 1 - x + column) *
                         (y - row if j else 1 - y + row) for i in (0, 1) for j in (0, 1)))
    return np.stack(found).reshape(*uv.shape[:-1], -1)


def halves(tex):
    """Levels of [H, W, C]."""
    levels = [tex]
    while max(levels[-1].shape[:2]) > 1:
        height, width, channels = levels[-1].shape
        rows, columns = min(height, 2), min(width, 2)
        levels.append(levels[-1].reshape(height // rows, rows, width // columns, columns, channels).mean((1, 3)))
    return levels


def numbered(size, faces=()):
    """A texture of zeros, and smaller images that hold their levels: what is sampled is the level."""
    levels = [torch.full((1, *faces, size >> i, size >> i, 1), float(i)) for i in range(size.bit_length())]
    return levels[0], levels[1:]


class NvdiffrastTextureTest(tensors.TestCase):
    def check_gradients(self, function, named, step):
        """named: values by name."""
        leaves = {name: values.clone().requires_grad_() for name, values in named.items()}
        function(**leaves).backward()
        for name, values in named.items():
            with self.subTest(name):
                wanted = differences(lambda moved, name=name: function(**{**named, name: moved}), values, step)
                self.check_close(leaves[name].grad, wanted, 5e-3)

    def test_bilinear_and_nearest(self):
        tex, uv = random(2, H, W, 3), 3 * random(2, 9, 11, 2, seed=2) - 1
        for boundary in ("wrap", "clamp", "zero"):
            for mode in ("auto", "linear", "nearest"):
                wanted = np.stack([by_hand(tex[i], uv[i], boundary, mode == "nearest") for i in (0, 1)])
                self.check_close(dr.texture(tex, uv, filter_mode=mode, boundary_mode=boundary), wanted, 1e-5)
                found = dr.texture(tex[1:], uv, filter_mode=mode, boundary_mode=boundary)
                self.check_close(found[1], wanted[1], 1e-5)
                self.check_close(found[0], by_hand(tex[1], uv[0], boundary, mode == "nearest"), 1e-5)

    def test_levels(self):
        """The sampled level is the longest way over texels that a pixel to the right and up can mean."""
        tex, mip = numbered(64)
        uv_da = 0.3 * (random(1, 6, 7, 4) - 0.5)
        uv_da[0, 0] *= 0.01
        uv_da[0, 1] *= 100
        lengths = np.linalg.svd(64 * uv_da.double().numpy().reshape(6, 7, 2, 2), compute_uv=False)[..., 0]
        wanted = np.clip(np.log2(lengths), 0, 6)[None, ..., None]
        uv, bias = random(1, 6, 7, 2), random(1, 6, 7, seed=3) - 0.5
        self.check_close(dr.texture(tex, uv, uv_da, mip=mip), wanted, 1e-5)
        rounded = dr.texture(tex, uv, uv_da, mip=mip, filter_mode="linear-mipmap-nearest")
        self.check_close(rounded, np.floor(wanted + 0.5), 1e-5)
        self.check_close(dr.texture(tex, uv, uv_da, mip=mip, max_mip_level=2), np.clip(wanted, 0, 2), 1e-5)
        biased = np.clip(np.log2(lengths) + bias[0].numpy(), 0, 6)[None, ..., None]
        self.check_close(dr.texture(tex, uv, uv_da, bias, mip), biased, 1e-5)
        self.check_close(dr.texture(tex, uv, mip_level_bias=6 * bias.abs(), mip=mip)[..., 0], 6 * bias.abs(), 1e-5)
        cube, cube_mip = numbered(64, (6,))
        direction, by_pixel = random(1, 6, 7, 3, seed=5) - 0.5, 0.1 * (random(1, 6, 7, 6) - 0.5)
        found = dr.texture(cube, direction, by_pixel, mip=cube_mip, boundary_mode="cube")
        h = 1e-5
        d, da = direction.double().numpy()[0], by_pixel.double().numpy().reshape(6, 7, 3, 2)
        axis, columns = np.abs(d).argmax(-1)[..., None], []
        for k in (0, 1):
            ahead, behind = (np.delete((d + sign * h * da[..., k]).reshape(-1, 3) /
                                       np.take_along_axis(d + sign * h * da[..., k], axis, -1).reshape(-1, 1), [], 1)
                             for sign in (1, -1))
            columns.append((ahead - behind) / (2 * h) * 32)
        lengths = np.linalg.svd(np.stack(columns, -1), compute_uv=False)[:, 0].reshape(1, 6, 7, 1)
        self.check_close(found, np.clip(np.log2(lengths), 0, 6), 1e-4)

    def test_mipmaps(self):
        tex, uv = random(1, H, W, 2), 2 * random(1, 5, 6, 2, seed=2) - 0.5
        levels = [by_hand(level, uv, "wrap") for level in halves(tex[0])]
        bias = 4.5 * random(1, 5, 6, seed=4)
        lower, part = bias.long().numpy(), (bias % 1).numpy()[..., None]
        wanted = sum(np.where((lower == i)[..., None], (1 - part) * levels[i] + part * levels[min(i + 1, 4)], 0)
                     for i in range(5))
        self.check_close(dr.texture(tex, uv, mip_level_bias=bias), wanted, 1e-5)
        mip = dr.texture_construct_mip(tex)
        self.check_close(dr.texture(tex, uv, mip_level_bias=bias, mip=mip), wanted, 1e-5)
        wide = random(1, 6, 4, 2)  # of which 3 x 2 cannot be halved
        self.assertEqual(dr.texture(wide, uv, mip_level_bias=bias, max_mip_level=1).shape, (1, 5, 6, 2))

    def test_gradients(self):
        weights = random(1, 4, 5, 2, seed=9).double()
        places = torch.randint(0, 16, (1, 4, 5, 2), generator=torch.Generator().manual_seed(3))
        uv = (places + 0.6 + 0.3 * random(1, 4, 5, 2)) / torch.tensor([W, H])  # not near the middle of a texel
        bias, uv_da = 0.3 + 0.2 * random(1, 4, 5), 0.3 * (random(1, 4, 5, 4, seed=7) - 0.5)
        for boundary in ("wrap", "clamp", "zero"):
            def loss(tex, uv, mode=boundary):
                return (dr.texture(tex, uv, boundary_mode=mode) * weights).sum()

            self.check_gradients(loss, {"tex": random(1, H, W, 2), "uv": uv}, 1e-3)
        self.check_gradients(lambda tex: (dr.texture(tex, uv, filter_mode="nearest") * weights).sum(),
                             {"tex": random(1, H, W, 2)}, 1e-3)
        self.check_gradients(lambda tex, bias: (dr.texture(tex, uv, mip_level_bias=bias) * weights).sum(),
                             {"tex": random(1, H, W, 2), "bias": bias}, 1e-3)
        self.check_gradients(lambda tex, uv_da: (dr.texture(tex, uv, uv_da) * weights).sum(),
                             {"tex": random(1, H, W, 2), "uv_da": uv_da}, 2e-4)
        nowhere = torch.zeros(1, 4, 5, 4, requires_grad=True)
        dr.texture(random(1, H, W, 2), uv, nowhere).sum().backward()
        self.assertTrue((nowhere.grad == 0).all())

    def test_cube_maps(self):
        size = 8
        middles = (np.arange(size) + 0.5) / size * 2 - 1
        t, s = np.meshgrid(middles, middles, indexing="ij")
        cube = torch.tensor(np.stack([np.stack(np.broadcast_arrays(*of_face(s, t)), -1) for of_face in OF_FACES]),
                            dtype=torch.float32)[None]
        # Within a face, colours that are linear in (s, t) are what is sampled.
        directions = 2 * random(1, 40, 50, 3, seed=2) - 1
        on_cube = directions / directions.abs().amax(-1, keepdim=True)
        sides = on_cube.abs().sort(-1)[0][..., 1]
        inner, outer = sides < 1 - 1 / size, sides > 1 - 1 / size
        found = dr.texture(cube, directions, boundary_mode="cube")
        self.assertGreater(inner.sum(), 1000)
        self.check_close(found[inner], on_cube[inner], 1e-5)
        # Across edges and corners they go on: between 1 - 1 / size on either side.
        self.check_close(found[outer], on_cube[outer], 1.01 / size)
        nearest = dr.texture(cube, directions, filter_mode="nearest", boundary_mode="cube")
        self.check_close(nearest, on_cube, 1.01 / size)
        edge = torch.tensor([[[[1, 0.3, 1], [1, 1, -0.2], [1, 1, 1], [-1, 1, -1]]]])
        beside = edge + 1e-4 * torch.cat([torch.eye(3), -torch.eye(3)])[:, None, None]
        around = dr.texture(cube, beside, boundary_mode="cube")
        self.assertLess((around.amax(0) - around.amin(0)).max(), 1e-2)
        self.check_close(around[0, 0, 2], np.full(3, 1 - 2 / 3 / size), 1e-3)  # the mean of a corner's three texels
        weights = random(1, 3, 4, 3, seed=9).double()
        corners = directions[:, :3, :4]
        self.check_gradients(lambda tex, uv: (dr.texture(tex, uv, boundary_mode="cube") * weights).sum(),
                             {"tex": cube, "uv": corners}, 1e-3)
        mip = dr.texture_construct_mip(cube, cube_mode=True)
        bias = torch.full((1, 40, 50), 1.0)
        level = dr.texture(cube, directions, mip_level_bias=bias, mip=mip, boundary_mode="cube")
        self.check_close(level[sides < 1 - 2 / size], on_cube[sides < 1 - 2 / size], 1e-5)
        with self.assertRaisesRegex(ValueError, "mip .*cube_mode"):
            dr.texture(random(1, H, H, 3), random(1, 4, 4, 2), mip_level_bias=bias[:, :4, :4], mip=mip)


if __name__ == "__main__":
    unittest.main()
