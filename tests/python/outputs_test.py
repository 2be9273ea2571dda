"""Outputs beside the image that have gradients, in the Python package `dpr`."""
import sys
import unittest
import warnings

try:
    import torch
except ImportError:
    print("skipped: no python3-torch")
    sys.exit(0)

import dpr
from package_test import (FACES, RELEASE, SIZE, SMOOTH, SQUARE, SQUARE_FACES, TETRAHEDRON, CompiledTest, RenderTest,
                          cameras, random)

MESH = (SQUARE, SQUARE_FACES)
NAMES = ("depth", "position", "normal", "texcoords")
SURFACE = {"texcoords": random(5, 2), "textures": random(4, 4, 3)}


class OutputsTest(RenderTest):
    def weighed(self, images, outputs):
        """A sum that has numbers of every output, by how much of it is seen."""
        total = 0
        for i, tensor in enumerate(outputs.values()):
            channels = tensor.reshape(*images.shape[:3], -1)
            total = total + (channels * images[..., 3:] * (random(*channels.shape, seed=i) - 0.5)).double().sum()
        return total

    def test_values(self):
        """Values of a wall before the camera, and outputs without a gradient."""
        views, intrinsics = cameras(2)
        wall = torch.tensor([[-9.0, -9.0, 0.0], [9.0, -9.0, 1.0], [0.0, 9.0, 0.0]])
        corners = torch.tensor([[0.0, 0.0], [1.0, 0.0], [0.5, 2.0]])
        _, outputs = dpr.render(wall, FACES[:1], views, intrinsics, width=SIZE, height=SIZE, texcoords=corners,
                                textures=random(2, 2, 3), outputs=[*NAMES, "barycentrics", "uv"], blur=0.25)
        self.assertEqual(list(outputs), [*NAMES, "barycentrics", "uv"])
        inner = (slice(None), slice(2, -2), slice(2, -2))
        places = (outputs["barycentrics"] @ wall)[inner]
        self.assert_same(outputs["position"][inner], places, 1e-4)
        self.assert_same(outputs["depth"][inner], -(places[..., 2] + views[:, 2, 3, None, None]), 1e-4)
        self.assert_same(outputs["texcoords"][inner], outputs["uv"][inner], 1e-4)
        normal = torch.linalg.cross(wall[1] - wall[0], wall[2] - wall[0])
        self.assert_same(outputs["normal"][inner], (normal / normal.norm()).expand_as(places), 1e-5)

    def test_nothing_where_nothing_is(self):
        images, outputs = dpr.render(*MESH, *cameras(1), width=SIZE, height=SIZE, outputs=NAMES, **SMOOTH, **SURFACE)
        self.assertEqual(images[0, 0, 0, 3], 0)
        for tensor in outputs.values():
            self.assertEqual(tensor[0, 0, 0].abs().max(), 0)
            self.assertTrue(tensor.isfinite().all())

    def test_gradients(self):
        views, intrinsics = cameras(2)
        renderer = dpr.Renderer(SIZE, SIZE, **SMOOTH)
        given = {"vertices": SQUARE, "intrinsics": intrinsics, "texcoords": SURFACE["texcoords"],
                 "sigma": torch.tensor(0.05), "gamma": torch.tensor(0.3)}
        turn, shift = torch.zeros(2, 3, dtype=torch.double), torch.zeros(2, 3, dtype=torch.double)

        def moved(turn, shift):
            """The views turned about the camera, A <- exp([r]x) A, and shifted."""
            x, y, z = turn.unbind(1)
            none = torch.zeros_like(x)
            skew = torch.stack([none, -z, y, z, none, -x, -y, x, none], 1).view(2, 3, 3)
            rows = torch.cat((torch.linalg.matrix_exp(skew) @ views[:, :3, :3].double(),
                              views[:, :3, 3:].double() + shift[..., None]), 2)
            return torch.cat((rows.float(), views[:, 3:]), 1)

        def loss(turn, shift, *values):
            numbers = {name: value.float() for name, value in zip(given, values)}
            return self.weighed(*renderer(faces=SQUARE_FACES, views=moved(turn, shift), textures=SURFACE["textures"],
                                          outputs=NAMES, **numbers))

        doubles = [turn.requires_grad_(), shift.requires_grad_()]
        doubles += [tensor.double().requires_grad_() for tensor in given.values()]
        self.assertTrue(torch.autograd.gradcheck(loss, doubles, eps=1e-3, atol=2e-2, rtol=2e-3))

    def test_shapes_of_views_and_one_output_alone(self):
        views, intrinsics = cameras(2)
        renderer = dpr.Renderer(SIZE, SIZE, **SMOOTH)
        one = SQUARE.clone().requires_grad_()
        several = SQUARE.repeat(2, 1, 1).requires_grad_()
        weights = random(2, SIZE, SIZE)
        for vertices in (one, several):
            _, outputs = renderer(vertices, SQUARE_FACES, views, intrinsics, outputs=["normal", "depth"])
            (outputs["depth"] * weights).sum().backward()
        self.assertGreater(one.grad.abs().sum(), 0)
        self.assert_same(several.grad.sum(0), one.grad, 1e-3 * one.grad.abs().max())
        colors = random(5, 3).requires_grad_()
        images, outputs = renderer(*MESH, views, intrinsics, colors=colors, outputs=["depth"])
        self.assertTrue(images.requires_grad)
        self.assertFalse(outputs["depth"].requires_grad)  # it does not depend on colours

    def test_frames_do_not_disturb_each_other(self):
        renderer = dpr.Renderer(SIZE, SIZE, **SMOOTH)

        def call(scale, **settings):
            vertices = (scale * SQUARE).requires_grad_()
            given = dpr.Renderer(SIZE, SIZE, **{**SMOOTH, **settings}) if settings else renderer
            images, outputs = given(vertices, SQUARE_FACES, *cameras(1), outputs=["depth", "normal"])
            return vertices, self.weighed(images, outputs)

        alone, loss = call(1.0)
        loss.backward()
        flights = [call(1.0), call(0.7), call(1.0, znear=1e-10, zfar=2e-10 + 9, gamma=0.5)]
        for vertices, loss in flights:
            loss.backward(retain_graph=True)
            loss.backward()
        self.assert_same(flights[0][0].grad, 2 * alone.grad)
        dpr.release()
        vertices, loss = call(1.0)
        loss.backward()
        self.assert_same(vertices.grad, alone.grad)

    def test_no_call_depends_on_the_last_one(self):
        """Kept images' views and smoothing need not go with those of the next call, either of which is set first."""
        views, intrinsics = cameras(1)

        def depth(znear=1, zfar=10, gamma=5e-2, projection=intrinsics):
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                return dpr.render(SQUARE, SQUARE_FACES, views, projection, width=SIZE, height=SIZE, outputs=["depth"],
                                  **{**SMOOTH, "znear": znear, "zfar": zfar, "gamma": gamma})[1]["depth"]

        for arguments in ({}, {"gamma": 1e-20}):
            dpr.release()
            expected = depth(**arguments)
            self.assertGreater(expected.sum(), 10)
            for last in ({"znear": 1e10, "zfar": 2e10}, {"znear": 1e-20, "zfar": 2e-20},
                         {"projection": torch.tensor([[3.0]])}):
                with self.subTest(str(arguments), after=str(last)):
                    depth(**last)
                    self.assert_same(depth(**arguments), expected)

    def test_meshes_that_differ(self):
        views, intrinsics = cameras(2)
        meshes = [TETRAHEDRON.clone().requires_grad_(), SQUARE.clone().requires_grad_()]
        alone = [mesh.detach().clone().requires_grad_() for mesh in meshes]
        renderer = dpr.Renderer(SIZE, SIZE, **SMOOTH)
        _, listed = renderer(meshes, [FACES, SQUARE_FACES], views, intrinsics, outputs=["position"])
        single = [renderer(alone[i], faces, views[i:i + 1], intrinsics[i:i + 1], outputs=["position"])[1]["position"]
                  for i, faces in enumerate([FACES, SQUARE_FACES])]
        self.assert_same(listed["position"], torch.cat(single))
        (listed["position"].square().sum() + torch.cat(single).square().sum()).backward()
        for mesh, other in zip(meshes, alone):
            self.assertGreater(mesh.grad.abs().sum(), 0)
            self.assert_same(mesh.grad, other.grad)

    def test_fit_by_depth(self):
        views, intrinsics = cameras(2)
        renderer = dpr.Renderer(SIZE, SIZE, **SMOOTH)

        def shown(vertices):
            images, outputs = renderer(vertices, SQUARE_FACES, views, intrinsics, outputs=["depth"])
            return torch.stack((outputs["depth"] * images[..., 3], images[..., 3]))

        target, vertices = shown(SQUARE), (0.8 * SQUARE + 0.1).requires_grad_()
        optimizer = torch.optim.Adam([vertices], lr=0.02)
        losses = []
        for _ in range(60):
            optimizer.zero_grad()
            loss = (shown(vertices) - target).square().mean()
            loss.backward()
            optimizer.step()
            losses.append(loss.item())
        self.assertLess(losses[-1], 0.05 * losses[0])

    def test_wrong_arguments(self):
        views, intrinsics = cameras(1)
        arguments = [*MESH, views, intrinsics]
        with self.assertRaisesRegex(RuntimeError, "texcoords .* got a mesh that has no texture coordinates"):
            dpr.render(*arguments, width=SIZE, height=SIZE, outputs=["texcoords"])
        vertices = SQUARE.clone().requires_grad_()
        for faces in (SQUARE_FACES[:0], [SQUARE_FACES[:0]]):  # show nothing, which a step of training should survive
            of = [vertices] if isinstance(faces, list) else vertices
            _, outputs = dpr.render(of, faces, views, intrinsics, width=SIZE, height=SIZE, outputs=["depth", "normal"])
            (gradient,) = torch.autograd.grad(sum(output.sum() for output in outputs.values()), vertices)
            self.assertEqual(float(gradient.abs().max()), 0)
        with self.assertRaisesRegex(TypeError, "vertices .*layout torch.sparse_coo"):
            dpr.render(SQUARE.to_sparse(), SQUARE_FACES, views, intrinsics, width=SIZE, height=SIZE)
        _, outputs = dpr.render(vertices, SQUARE_FACES, views, intrinsics, width=SIZE, height=SIZE, outputs=["depth"])
        (gradient,) = torch.autograd.grad(outputs["depth"].sum(), vertices, create_graph=True)
        with self.assertRaisesRegex(RuntimeError, "no second derivatives"):
            gradient.sum().backward()


@unittest.skipIf(RELEASE < (2, 4), "no torch.library.register_fake")
class CompiledOutputsTest(CompiledTest):
    def test_outputs(self):
        views, intrinsics = cameras(2)

        def loss(vertices, texcoords, sigma):
            images, outputs = dpr.render(2 * vertices, SQUARE_FACES, views, intrinsics, width=SIZE, height=SIZE,
                                         znear=1, zfar=20, texcoords=texcoords, textures=SURFACE["textures"], sigma=sigma,
                                         gamma=0.05, preset="joint_gaussian", outputs=[*NAMES, "face_id"])
            seen = images[..., 3] * (outputs["face_id"] >= 0)
            return sum((tensor.reshape(*seen.shape, -1).square().sum(-1) * seen).mean()
                       for name, tensor in outputs.items() if name != "face_id")

        arguments = (SQUARE / 2, SURFACE["texcoords"], torch.tensor(5e-3))
        self.check(loss, arguments, backend="aot_eager")
        self.check(loss, arguments, backend="inductor")


if __name__ == "__main__":
    unittest.main(verbosity=2)
