"""dpr.nvdiffrast against references of its own: pixel centres in triangles, textures by hand, differences of images."""
import io
import sys
import unittest
from unittest import mock

try:
    import numpy as np
    import torch
except ImportError:
    print("skipped: no python3-numpy or python3-torch")
    sys.exit(0)

import dpr.nvdiffrast as dr
import tensors
from dpr import _clip_frames
from tensors import differences, random

H, W = 40, 56
NEAR, FAR = 0.5, 20.0
PROJECTION = np.array([[1.5, 0, 0, 0], [0, 1.5 * W / H, 0, 0],
                       [0, 0, -(FAR + NEAR) / (FAR - NEAR), -2 * FAR * NEAR / (FAR - NEAR)], [0, 0, -1, 0]])
CUBE = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], np.float64)
CUBE_FACES = np.array([[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6],
                       [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]], np.int32)
FLOOR = np.array([[-3, -1, 2], [3, -1, 2], [3, -1, -60], [-3, -1, -60]], np.float64)
FLOOR_FACES = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
CONTEXT = dr.RasterizeCudaContext()


def turned(angle, tilt, distance):
    c, s, d, t = np.cos(angle), np.sin(angle), np.cos(tilt), np.sin(tilt)
    matrix = np.eye(4)
    matrix[:3, :3] = np.array([[1, 0, 0], [0, d, -t], [0, t, d]]) @ np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    matrix[2, 3] = -distance
    return PROJECTION @ matrix


def clip(vertices, *matrices):
    homogeneous = np.concatenate([vertices, np.ones((len(vertices), 1))], 1)
    return torch.tensor(np.stack([homogeneous @ matrix.T for matrix in matrices]), dtype=torch.float32)


def weights_at(pos, tri, x, y):
    """[P, T, 3] of points in pixels: weights whose sum of (x, y, w) is (X, Y, 1)."""
    corners = pos.numpy().astype(np.float64)[tri]
    point = np.stack([2 * x / W - 1, 2 * y / H - 1, np.ones_like(x)], -1)
    return np.einsum("tij,pj->pti", np.linalg.inv(corners[..., (0, 1, 3)].transpose(0, 2, 1)), point)


def reference(pos, tri):
    """(rast, rast_db, least weight of the triangle shown or the largest of the least of all others), [H, W, ...]"""
    y, x = (grid.reshape(-1) + 0.5 for grid in np.mgrid[:H, :W].astype(np.float64))
    weights = weights_at(pos, tri, x, y)
    depth = np.einsum("pti,ti->pt", weights, pos.numpy()[tri][..., 2])
    is_hit = (weights >= 0).all(-1) & (np.abs(depth) <= 1)
    face = np.where(is_hit, depth, np.inf).argmin(1)
    points = np.arange(len(x))

    def of_face(x, y):
        own = weights_at(pos, tri, x, y)[points, face]
        return (own / own.sum(-1, keepdims=True))[:, :2]

    h = 1e-4
    by_x, by_y = ((of_face(x + dx, y + dy) - of_face(x - dx, y - dy)) / (2 * h) for dx, dy in ((h, 0), (0, h)))
    seen = is_hit[points, face][:, None]
    rast = np.concatenate([of_face(x, y), depth[points, face][:, None], 1.0 + face[:, None]], 1) * seen
    total = weights.sum(-1)
    edge = np.abs((weights / np.where(total == 0, 1, total)[..., None])).min(-1).min(1)
    return (rast.reshape(H, W, 4), (np.stack([by_x, by_y], -1).reshape(-1, 4) * seen).reshape(H, W, 4),
            edge.reshape(H, W))


class NvdiffrastTest(tensors.TestCase):
    def check_rast(self, pos, tri, least_seen):
        rast, rast_db = dr.rasterize(CONTEXT, pos, torch.from_numpy(tri), resolution=[H, W])
        self.assertEqual((rast.shape, rast_db.shape), ((len(pos), H, W, 4), (len(pos), H, W, 4)))
        for i in range(len(pos)):
            wanted, wanted_db, edge = reference(pos[i], tri)
            inside = edge > 1e-4
            self.assertGreater((wanted[..., 3] > 0)[inside].mean(), least_seen)
            self.assertTrue((rast[i, ..., 3].numpy() == wanted[..., 3])[inside].all())
            self.assertLess(np.abs(rast[i].numpy() - wanted)[inside].max(), 1e-4)
            of_db = np.abs(rast_db[i].numpy() - wanted_db) / (1 + np.abs(wanted_db))
            self.assertLess(of_db[inside].max(), 1e-3)

    def test_rasterize_one_projection(self):
        self.check_rast(clip(CUBE, turned(0.5, 0.4, 4), turned(-1.2, -0.3, 6)), CUBE_FACES, 0.05)

    def test_rasterize_through_the_camera_and_beyond_the_far_plane(self):
        self.check_rast(clip(FLOOR, turned(0.0, 0.0, 0), turned(0.3, 0.2, 1)), FLOOR_FACES, 0.2)
        self.check_rast(clip(FLOOR * [1, 0.2, 1], turned(0.0, 0.0, 0)), FLOOR_FACES, 0.2)  # the near plane is seen
        self.check_rast(clip(CUBE, turned(0.5, 0.4, 1.2)), CUBE_FACES, 0.5)  # from within

    def test_rasterize_orthographic(self):
        flat = torch.tensor([[[-0.8, -0.8, 0, 1], [0.8, -0.8, 0.5, 1], [-0.8, 0.8, -0.5, 1], [0.9, 0.7, 0.1, 1],
                              [0.5, -0.5, -3, 1]]])
        self.check_rast(flat, np.array([[0, 1, 2], [1, 3, 2], [0, 3, 1], [0, 4, 3]], np.int32), 0.3)

    def test_rasterize_no_projection(self):
        pos = clip(CUBE, turned(0.5, 0.4, 4))
        self.check_rast(pos * torch.tensor([1.0, 1, -1, 1]), CUBE_FACES, 0.05)  # the furthest is seen
        pos[..., 2] = pos[..., 3] * (1.2 - 0.2 * pos[..., 3] - 0.1 * pos[..., 0])
        self.check_rast(pos, CUBE_FACES, 0.05)
        pos[:, 0, 3] = -1
        with self.assertRaisesRegex(ValueError, r"pos .*affine"):
            dr.rasterize(CONTEXT, pos, torch.from_numpy(CUBE_FACES), [H, W])

    def test_ranges(self):
        matrices = turned(0.5, 0.4, 4), turned(0.2, 0.3, 5)
        cube, floor = clip(CUBE, *matrices), clip(FLOOR, *matrices)
        pos = torch.cat([cube[0], floor[1]])
        tri = torch.cat([torch.from_numpy(CUBE_FACES), 8 + torch.from_numpy(FLOOR_FACES)])
        attr, ranges = random(12, 3), torch.tensor([[0, 12], [12, 2], [3, 0]], dtype=torch.int32)
        leaf = pos.requires_grad_()
        with mock.patch.object(_clip_frames, "_Frame", wraps=_clip_frames._Frame) as made:
            rast, rast_db = dr.rasterize(CONTEXT, leaf, tri, [H, W], ranges=ranges)
        self.assertEqual(made.call_count, 1)
        color, derivatives = dr.interpolate(attr, rast, tri, rast_db, "all")
        image = dr.antialias(color, rast, leaf, tri)
        (image * random(*image.shape)).sum().backward()
        self.assertTrue((rast[2] == 0).all() and (image[2] == 0).all())
        for i, (part, faces, first, vertices) in enumerate(((cube[:1], CUBE_FACES, 0, slice(0, 8)),
                                                            (floor[1:], FLOOR_FACES, 12, slice(8, 12)))):
            part, faces = part.detach().requires_grad_(), torch.from_numpy(faces)
            own, own_db = dr.rasterize(CONTEXT, part, faces, [H, W])
            own_color, own_derivatives = dr.interpolate(attr[None, vertices], own, faces, own_db, [0, -2, 2])
            self.check_close(rast[i, ..., :3], own[0, ..., :3], 1e-6)
            self.check_close(rast[i, ..., 3], own[0, ..., 3] + first * (own[0, ..., 3] > 0), 1e-6)
            self.check_close(derivatives[i], own_derivatives[0], 1e-6)
            own_image = dr.antialias(own_color, own, part, faces)
            self.check_close(image[i], own_image[0], 1e-6)
            (own_image * random(*image.shape)[i]).sum().backward()
            self.check_close(leaf.grad[vertices], part.grad[0], 1e-5)

    def test_pixels_that_show_nothing_have_no_gradient(self):
        """Whether their surfaces lie beyond the far plane or not, and whatever the gradient is there."""
        pos = clip(FLOOR * [1, 0.2, 1], turned(0.0, 0.0, 0)).requires_grad_()
        tri = torch.from_numpy(FLOOR_FACES)
        attr = random(5, 2) + 0.1
        attr[4] = float("nan")  # of no triangle
        attr.requires_grad_()
        rast, rast_db = dr.rasterize(CONTEXT, pos, tri, [H, W])
        empty = rast[..., 3:] == 0
        self.assertTrue(empty.any() and not empty.all())
        gradient, = torch.autograd.grad((rast[..., :2] * empty).sum(), pos, retain_graph=True)
        self.assertEqual(float(gradient.abs().max()), 0.0)
        values, steps = dr.interpolate(attr, rast, tri, rast_db, "all")
        wanted = torch.autograd.grad(values.masked_fill(empty, 1).sqrt().sum(), (pos, attr), retain_graph=True)
        found = torch.autograd.grad(values.sqrt().sum(), (pos, attr), retain_graph=True)  # whose gradient at 0 is infinite
        for gradient, own in zip(found, wanted):
            self.assertGreater(own.abs().max(), 0)
            self.check_close(gradient, own, 1e-6)
        with self.assertRaisesRegex(ValueError, "attr .*got nan"):
            dr.interpolate(attr[[4, 1, 2, 3]], rast, tri)
        first, = torch.autograd.grad(rast[..., 0].sum() + steps.sum(), pos, create_graph=True)
        with self.assertRaisesRegex(RuntimeError, "no second derivatives"):
            first.sum().backward()
        with torch.inference_mode():
            known, _ = dr.rasterize(CONTEXT, pos.detach(), tri, [H, W])
        dr.interpolate(attr, known, tri)[0].sum().backward()
        self.assertTrue((attr.grad[4] == 0).all() and attr.grad.abs().max() > 0)

    def test_gradients_of_rast(self):
        """By pos, of u and v and their derivatives, where no pixel changes its triangle."""
        tri = torch.from_numpy(FLOOR_FACES)
        no_projection = clip(CUBE[:4], turned(-1.4, 0.4, 4))
        no_projection[..., 2] *= 1 - 0.1 * no_projection[..., 0]
        for pos in (clip(FLOOR, turned(0.3, 0.2, 1)), clip(CUBE[[0, 1, 3, 2]], turned(-1.4, 0.4, 4)), no_projection):
            rast, _ = dr.rasterize(CONTEXT, pos, tri, [H, W])
            face = rast[..., 3:]
            inside = torch.nn.functional.max_pool2d((face == 0).float().permute(0, 3, 1, 2), 5, 1, 2) == 0
            for other in torch.nn.functional.unfold(face.permute(0, 3, 1, 2), 5, padding=2).split(1, 1):
                inside &= other.reshape(inside.shape) == face.permute(0, 3, 1, 2)
            inside = inside.permute(0, 2, 3, 1).float()
            self.assertGreater(inside.sum(), 30)
            for size, scale in ((2, 1.0), (4, 20.0)):
                weights = random(1, H, W, size) * inside

                def loss(pos):
                    values = dr.rasterize(CONTEXT, pos, tri, [H, W])
                    return (values[size > 2][..., :size].double() * weights).sum() * scale

                leaf = pos.clone().requires_grad_()
                loss(leaf).backward()
                of_z = leaf.grad[..., 2].abs().max() / leaf.grad.abs().max()
                self.assertLess(of_z, 1e-4)
                self.check_close(leaf.grad[..., (0, 1, 3)], differences(loss, pos, 2e-3)[..., (0, 1, 3)], 0.02)

    def test_interpolate(self):
        pos, tri = clip(CUBE, turned(0.5, 0.4, 4), turned(-1.2, -0.3, 6)), torch.from_numpy(CUBE_FACES)
        rast, rast_db = (array.detach().requires_grad_() for array in dr.rasterize(CONTEXT, pos, tri, [H, W]))
        for attr in (random(8, 5), random(1, 8, 5), random(2, 8, 5)):
            attr.requires_grad_()
            found, derivatives = dr.interpolate(attr, rast, tri, rast_db=rast_db, diff_attrs=[3, 0])
            corners = (attr if attr.ndim == 3 else attr[None]).expand(2, 8, 5)
            face = rast[..., 3].long() - 1
            a, b, c = (corners[torch.arange(2)[:, None, None], tri.long()[face.clamp(min=0)][..., k]] for k in range(3))
            u, v, mask = rast[..., :1], rast[..., 1:2], face[..., None] >= 0
            wanted = (u * a + v * b + (1 - u - v) * c) * mask
            du, dv = ((side - c) * mask for side in (a, b))
            of_3, of_0 = (rast_db[..., :2] * du[..., i, None] + rast_db[..., 2:] * dv[..., i, None] for i in (3, 0))
            wanted_derivatives = torch.cat([of_3, of_0], -1)
            self.check_close(found, wanted, 1e-6)
            self.check_close(derivatives, wanted_derivatives, 1e-6)
            sums = [(values * random(*values.shape)).sum() + (slopes * random(*slopes.shape)).sum()
                    for values, slopes in ((found, derivatives), (wanted, wanted_derivatives))]
            for own, expected in zip(*(torch.autograd.grad(total, [attr, rast, rast_db], retain_graph=True)
                                       for total in sums)):
                self.check_close(own, expected, 1e-5)
        found, derivatives = dr.interpolate(attr, rast, tri)
        self.assertEqual(derivatives.shape, (2, H, W, 0))

    def test_other_default_types(self):
        """Gradients do not depend on the type that tensors have by default."""
        pos, tri, attr = clip(CUBE, turned(0.5, 0.4, 4)), torch.from_numpy(CUBE_FACES), random(8, 3)

        def gradients():
            leaf = pos.clone().requires_grad_()
            rast, rast_db = dr.rasterize(CONTEXT, leaf, tri, [H, W])
            color, derivatives = dr.interpolate(attr, rast, tri, rast_db, "all")
            images = color, derivatives, dr.antialias(color, rast, leaf, tri)
            return [torch.autograd.grad(image.square().sum(), leaf, retain_graph=True)[0] for image in images]

        wanted = gradients()
        self.addCleanup(torch.set_default_dtype, torch.get_default_dtype())
        torch.set_default_dtype(torch.float64)
        for found, expected in zip(gradients(), wanted):
            self.assertTrue(torch.equal(found, expected))

    def test_antialias_covers_areas(self):
        pos = torch.tensor([[[-0.6, -0.7, 0.1, 1], [0.7, -0.5, 0.1, 1], [-0.1, 0.8, 0.1, 1]]])
        tri = torch.tensor([[0, 1, 2]])
        pos[0, 1] *= 2
        leaf, of_area = pos.clone().requires_grad_(), pos.clone().requires_grad_()
        rast, _ = dr.rasterize(CONTEXT, leaf, tri, [H, W])
        mask = (rast[..., 3:] > 0).float()
        image = dr.antialias(mask, rast, leaf, tri)
        most, least = (sign * torch.nn.functional.max_pool2d(sign * mask[..., 0], 3, 1, 1) for sign in (1, -1))
        edges = most != least
        self.check_close(image[..., 0] * ~edges, mask[..., 0] * ~edges, 1e-6)
        image.sum().backward()
        places = of_area[0, :, :2] / of_area[0, :, 3:] * torch.tensor([W / 2, H / 2])
        (x, y), (s, t) = places[1] - places[0], places[2] - places[0]
        area = (x * t - y * s) / 2
        area.backward()
        self.assertLess(abs(image.sum() - area) / area, 1e-3)
        self.check_close(leaf.grad, of_area.grad, 1e-3)
        # The same by other tensors, which are rasterized again, and times a factor.
        again = (pos * 1).requires_grad_()
        topology = dr.antialias_construct_topology_hash(tri)
        dr.antialias(mask, rast.detach(), again, tri, topology_hash=topology, pos_gradient_boost=3.0).sum().backward()
        self.check_close(again.grad, 3 * of_area.grad, 1e-3)
        with torch.no_grad():
            again, _ = dr.rasterize(CONTEXT, leaf, tri, [H, W])
            self.assertTrue(torch.equal(dr.antialias(mask, again, leaf, tri), image))
        moved = pos + torch.tensor([0.5, 0, 0, 0])
        other, _ = dr.rasterize(CONTEXT, moved, tri, [H, W])
        self.assertTrue(torch.equal(dr.antialias(mask, rast, moved, tri), dr.antialias(mask, other, moved, tri)))
        more = torch.cat([pos, torch.tensor([[[0.6, 0.9, 0.1, 1.0]]])], 1)
        rast, _ = dr.rasterize(CONTEXT, more, tri, [H, W])
        before = dr.antialias(mask, rast, more, tri)
        tri[0, 2] = 3  # in place
        other, _ = dr.rasterize(CONTEXT, more, tri, [H, W])
        found = dr.antialias(mask, rast, more, tri)
        self.assertTrue(torch.equal(found, dr.antialias(mask, other, more, tri)))
        self.assertFalse(torch.equal(found, before))

    def test_antialias_leaves_out_what_lies_beside_the_image(self):
        right = 2 * (W - 0.2) / W - 1  # beyond the centres of the last column
        pos = torch.tensor([[[-3, -3, 0, 1], [right, -3, 0, 1], [right, 3, 0, 1], [-3, 3, 0, 1]]])
        tri = torch.from_numpy(FLOOR_FACES)
        rast, _ = dr.rasterize(CONTEXT, pos, tri, [H, W])
        self.check_close(dr.antialias((rast[..., 3:] > 0).float(), rast, pos, tri), torch.ones(1, H, W, 1), 1e-6)

    def test_antialiased_gradient_is_the_images_change(self):
        """Gradients by a shift, summed over several pixels of motion."""
        y, x = torch.meshgrid(torch.linspace(0, 2, H), torch.linspace(0, 3, W), indexing="ij")
        weights = torch.stack([torch.sin(x + y), torch.cos(2 * x), torch.cos(y - x)], -1)
        for vertices, faces, matrix in ((CUBE, CUBE_FACES, turned(0.5, 0.4, 4)),
                                        (FLOOR * [1, 1, 0.25], FLOOR_FACES, turned(0.3, 0.2, 1))):
            tri, attr = torch.from_numpy(faces), random(len(vertices), 3, seed=4)
            pos = clip(vertices, matrix)

            def loss(shift):
                moved = pos + shift
                rast, _ = dr.rasterize(CONTEXT, moved, tri, [H, W])
                return (dr.antialias(dr.interpolate(attr, rast, tri)[0], rast, moved, tri) * weights).sum()

            for axis in (0, 1, 3):
                length, steps = 0.5, 48
                direction = torch.eye(4)[axis]
                if axis == 3:  # along a projection's way, so that depths keep their order
                    direction = torch.tensor([0, 0, -PROJECTION[2, 2], 1], dtype=torch.float32)
                total = 0.0
                for i in range(steps):
                    part = torch.tensor(((i + 0.5) / steps - 0.5) * float(length), requires_grad=True)
                    loss(part * direction).backward()
                    total += float(part.grad * length) / steps
                ends = [float(loss(sign * 0.5 * length * direction)) for sign in (1, -1)]
                self.assertLess(abs(total - (ends[0] - ends[1])), 0.01 * abs(ends[0] - ends[1]) + 0.1)

    def test_layers(self):
        """The second layer of a cube is what a cube without its front shows; there is no third."""
        pos, tri = clip(CUBE, turned(0.5, 0.4, 4)), torch.from_numpy(CUBE_FACES)
        with dr.DepthPeeler(CONTEXT, pos, tri, [H, W]) as peeler:
            (first, first_db), (second, second_db), (third, third_db) = (peeler.rasterize_next_layer() for _ in range(3))
        alone, alone_db = dr.rasterize(CONTEXT, pos, tri, [H, W])
        self.assertTrue(torch.equal(first, alone) and torch.equal(first_db, alone_db))
        self.assertFalse(third.any() or third_db.any())
        front = first[..., 3].unique()[1:].long() - 1
        rest = torch.ones(len(tri), dtype=torch.bool).index_fill(0, front, False)
        behind, behind_db = dr.rasterize(CONTEXT, pos, tri[rest], [H, W])
        number = torch.cat([torch.zeros(1), rest.nonzero()[:, 0] + 1.0])[behind[..., 3].long()]
        self.assertTrue(torch.equal(second[..., 3], number))
        self.assertLess(float((second[..., :3] - behind[..., :3]).abs().max()), 1e-5)
        self.assertLess(float((second_db - behind_db).abs().max()), 1e-4)

    def test_outlines_of_layers(self):
        """A square behind another that fills the image: the second layer's gradient is that of the square alone."""
        corners = torch.tensor([[-0.9, -0.9], [0.9, -0.9], [0.9, 0.9], [-0.9, 0.9]])
        tri = torch.tensor([[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]])
        found = []
        for peeled in (True, False):
            square = (0.5 * corners).requires_grad_()
            far = torch.cat([square, torch.full((4, 1), 0.5), torch.ones(4, 1)], 1)
            near = torch.cat([3 * corners, torch.full((4, 1), -0.5), torch.ones(4, 1)], 1)
            pos = torch.cat([near if peeled else far.detach() * 0, far])[None]
            with dr.DepthPeeler(CONTEXT, pos, tri, [H, W]) as peeler:
                for _ in range(2 if peeled else 1):
                    rast, _ = peeler.rasterize_next_layer()
            image = dr.antialias((rast[..., 3:] > 0).float().contiguous(), rast, pos, tri)
            found.append((image.detach(), *torch.autograd.grad(image.sum(), square)))
        for peeled, alone in zip(*found):
            self.assertGreater(float(alone.abs().max()), 0.5)
            self.assertLess(float((peeled - alone).abs().max()), 1e-4 * float(alone.abs().max()))

    def test_files_of_rast(self):
        pos, tri = clip(CUBE, turned(0.5, 0.4, 4)), torch.from_numpy(CUBE_FACES)
        rast, _ = dr.rasterize(CONTEXT, pos, tri, [H, W])
        file = io.BytesIO()
        torch.save(rast, file)
        file.seek(0)
        loaded, color = torch.load(file), random(1, H, W, 3)
        self.assertTrue(torch.equal(loaded, rast))
        self.assertTrue(torch.equal(dr.antialias(color, loaded, pos, tri), dr.antialias(color, rast, pos, tri)))

    def test_other_names(self):
        self.assertEqual(dr.get_log_level(), 1)
        dr.set_log_level(2)
        self.assertEqual(dr.get_log_level(), 2)
        dr.set_log_level(1)
        peeler = dr.DepthPeeler(CONTEXT, clip(CUBE, turned(0.5, 0.4, 4)), torch.from_numpy(CUBE_FACES), [H, W])
        with self.assertRaisesRegex(RuntimeError, "with statement"):
            peeler.rasterize_next_layer()
        context = dr.RasterizeGLContext(output_db=False, mode="manual", device="cuda:0")
        context.set_context()
        context.release_context()
        pos, tri = clip(CUBE, turned(0.5, 0.4, 4)).requires_grad_(), torch.from_numpy(CUBE_FACES)
        self.assertEqual(dr.rasterize(context, pos, tri, (H, W))[1].shape, (1, H, W, 0))
        rast, rast_db = dr.rasterize(CONTEXT, pos, tri, (H, W), grad_db=False)
        self.assertTrue(rast.requires_grad and not rast_db.requires_grad)
        behind = pos.detach() * torch.tensor([1.0, 1, 1, -1])
        for unseen in (behind, torch.zeros_like(behind)):
            rast, rast_db = dr.rasterize(CONTEXT, unseen, tri, (H, W))
            color, derivatives = dr.interpolate(random(8, 3), rast, tri, rast_db, "all")
            image = dr.antialias(color, rast, unseen, tri)
            self.assertTrue(all((array == 0).all() for array in (rast, rast_db, color, derivatives, image)))

    def test_what_is_refused(self):
        pos, tri = clip(CUBE, turned(0.5, 0.4, 4)), torch.from_numpy(CUBE_FACES)
        rast, rast_db = dr.rasterize(CONTEXT, pos, tri, [H, W])
        color, tex, uv = random(1, H, W, 3), random(1, 6, 8, 3), random(1, 4, 4, 2)
        nothing = torch.full_like(pos, float("nan"))
        for name, error, call in (
                ("glctx", TypeError, lambda: dr.rasterize(None, pos, tri, [H, W])),
                ("pos", ValueError, lambda: dr.rasterize(CONTEXT, pos[..., :3], tri, [H, W])),
                ("pos", ValueError, lambda: dr.rasterize(CONTEXT, nothing, tri, [H, W])),
                ("pos", TypeError, lambda: dr.rasterize(CONTEXT, pos.double(), tri, [H, W])),
                ("tri", TypeError, lambda: dr.rasterize(CONTEXT, pos, tri.float(), [H, W])),
                ("tri", ValueError, lambda: dr.rasterize(CONTEXT, pos[:, :4], tri, [H, W])),
                ("resolution", ValueError, lambda: dr.rasterize(CONTEXT, pos, tri, 64)),
                ("ranges", ValueError, lambda: dr.rasterize(CONTEXT, pos[0], tri, [H, W])),
                ("ranges", ValueError, lambda: dr.rasterize(CONTEXT, pos[0], tri, [H, W], torch.tensor([[3, 10]]))),
                ("ranges", ValueError, lambda: dr.rasterize(CONTEXT, pos, tri, [H, W], torch.tensor([[0, 12]]))),
                ("attr", ValueError, lambda: dr.interpolate(random(2, 8, 3), rast, tri)),
                ("rast_db", ValueError, lambda: dr.interpolate(random(8, 3), rast, tri, diff_attrs="all")),
                ("diff_attrs", ValueError, lambda: dr.interpolate(random(8, 3), rast, tri, rast_db, [3])),
                ("color", ValueError, lambda: dr.antialias(color[:, 1:], rast, pos, tri)),
                ("rast", ValueError, lambda: dr.antialias(color.repeat(2, 1, 1, 1), rast.repeat(2, 1, 1, 1), pos, tri)),
                ("topology_hash", TypeError, lambda: dr.antialias(color, rast, pos, tri, topology_hash=3)),
                ("mode", ValueError, lambda: dr.RasterizeGLContext(mode="magic")),
                ("level", ValueError, lambda: dr.set_log_level(7)),
                ("tex", ValueError, lambda: dr.texture(tex[0], uv)),
                ("tex", ValueError, lambda: dr.texture(random(1, 6, 4, 8, 3), rast[..., :3], boundary_mode="cube")),
                ("tex", ValueError, lambda: dr.texture_construct_mip(tex)),
                ("uv", ValueError, lambda: dr.texture(tex, random(1, 4, 4, 3))),
                ("uv_da", ValueError, lambda: dr.texture(tex, uv, random(1, 4, 4, 2))),
                ("uv_da", ValueError, lambda: dr.texture(tex, uv, filter_mode="linear-mipmap-linear")),
                ("filter_mode", ValueError, lambda: dr.texture(tex, uv, filter_mode="cubic")),
                ("boundary_mode", ValueError, lambda: dr.texture(tex, uv, boundary_mode="mirror")),
                ("mip", ValueError, lambda: dr.texture(tex, uv, random(1, 4, 4, 4), mip=[tex]))):
            with self.subTest(name), self.assertRaisesRegex(error, rf"dpr: error: {name} \(dpr.nvdiffrast"):
                call()


if __name__ == "__main__":
    unittest.main()
