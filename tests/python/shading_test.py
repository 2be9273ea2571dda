"""Metal and roughness, normal maps, environments and shadows in the Python package: dpr.shading."""
import math
import sys
import unittest

try:
    import torch
except ImportError:
    print("skipped: no python3-torch")
    sys.exit(0)

import dpr
from dpr import shading

UP = torch.tensor([0.0, 1.0, 0.0])


def random(*shape, seed=0):
    return torch.rand(*shape, generator=torch.Generator().manual_seed(seed))


def directions(count):
    """(unit vectors, solid angle of each) of a spiral on the sphere."""
    y = 1 - 2 * (torch.arange(count) + 0.5) / count
    turn = torch.arange(count) * (math.pi * (3 - 5**0.5))
    ring = (1 - y * y).sqrt()
    return torch.stack((ring * turn.cos(), y, ring * turn.sin()), -1), 4 * math.pi / count


def at_angle(degrees):
    return torch.tensor([math.sin(math.radians(degrees)), math.cos(math.radians(degrees)), 0.0])


def reflected(environment_light, to_eye, *material):
    """What a surface facing up sends of light from all around, summed up direction by direction."""
    to_light, angle = directions(20000)
    shares = shading.metallic_roughness(UP, to_eye, to_light, *material)
    return (shares * environment_light(to_light)).sum(0) * angle


class ReflectionTest(unittest.TestCase):
    COLOR = torch.tensor([0.9, 0.5, 0.1])

    def test_values(self):
        """A rough dielectric, seen and lit from above, by hand: F = 0.04, D = 1 / pi, V = 1 / 4."""
        value = shading.metallic_roughness(UP, UP, UP, self.COLOR, 0.0, 1.0)
        torch.testing.assert_close(value, (0.96 * self.COLOR + 0.04 / 4) / math.pi)
        metal = shading.metallic_roughness(UP, UP, UP, self.COLOR, 1.0, 0.5)
        torch.testing.assert_close(metal, self.COLOR / (4 * math.pi * 0.25**2))
        below = shading.metallic_roughness(UP, UP, -UP, self.COLOR, 0.5, 0.5)
        self.assertEqual(below.abs().max(), 0)

    def test_unit(self):
        vectors = torch.tensor([[3.0, 0, 4], [0, 0, 0]], requires_grad=True)
        units = shading.unit(vectors)
        torch.testing.assert_close(units, torch.tensor([[0.6, 0, 0.8], [0, 0, 0]]))
        gradient, = torch.autograd.grad(units[:, 0].sum(), vectors)
        torch.testing.assert_close(gradient, torch.tensor([[0.128, 0, -0.096], [0, 0, 0]]))
        with self.assertRaisesRegex(ValueError, "vectors .*ndarray"):
            shading.unit(vectors.detach().numpy())

    def test_light_and_eye_change_places(self):
        a, b = at_angle(20), at_angle(-65)
        there, back = (shading.metallic_roughness(UP, *pair, self.COLOR, 0.3, 0.4) / pair[1][1] for pair in ((a, b), (b, a)))
        torch.testing.assert_close(there, back)

    def test_no_more_light_than_comes(self):
        """A white metal loses what bounces between its facets: at a roughness of 1, seen from above, ln 2 of the light."""
        for degrees in (0, 50, 80):
            for roughness in (0.25, 0.6, 1.0):
                light = reflected(lambda _: torch.ones(3), at_angle(degrees), torch.ones(3), 1.0, roughness)
                self.assertLess(light.max(), 1.001, (degrees, roughness))
        whole = reflected(lambda _: torch.ones(3), UP, torch.ones(3), 1.0, 1.0)
        torch.testing.assert_close(whole, torch.full((3,), 1 - math.log(2)), atol=1e-3, rtol=0)

    def test_gradients(self):
        tensors = [shading.unit(0.2 + random(5, 3, seed=k)).double() for k in range(3)]
        tensors += [random(5, 3, seed=4).double(), random(5, 1, seed=5).double(), 0.3 + 0.5 * random(5, 1, seed=6).double()]
        tensors = [tensor.requires_grad_() for tensor in tensors]
        self.assertTrue(torch.autograd.gradcheck(shading.metallic_roughness, tensors))
        nothing = torch.zeros(1, 3, requires_grad=True)
        shading.metallic_roughness(nothing, UP, UP, self.COLOR, 0.5, 0.0).sum().backward()
        self.assertTrue(nothing.grad.isfinite().all())


class MicrofacetTest(unittest.TestCase):
    def test_renderers_lights_reflect_as_glTF_says(self):
        """Image and gradients of a sphere in a point light of each of two views, by the renderer's lights and by shading of
        one's own."""
        y, turn = torch.meshgrid(torch.linspace(-0.98, 0.98, 14), torch.arange(24) / 24 * 2 * math.pi, indexing="ij")
        ring = (1 - y * y).sqrt()
        vertices = torch.stack((ring * turn.sin(), y, ring * turn.cos()), -1).reshape(-1, 3)
        row, column = torch.meshgrid(torch.arange(13), torch.arange(24), indexing="ij")
        a, b = (row * 24 + column).reshape(-1), (row * 24 + (column + 1) % 24).reshape(-1)
        faces = torch.cat((torch.stack((a, b, b + 24), 1), torch.stack((a, b + 24, a + 24), 1)))
        eyes = torch.tensor([[0.4, 0.8, 3.5], [-2.5, 1.0, 2.0]])
        views = torch.cat([dpr.look_at(eye) for eye in eyes])
        intrinsics = torch.from_numpy(dpr.perspective(40, 40, 32))
        lamps = torch.tensor([[2.0, 2.5, 3.0], [-3.5, 1.0, -0.5]])
        light = torch.tensor([0.9, 0.7, 0.5])  # irradiance over pi
        renderer = dpr.Renderer(40, 32, shading="microfacet")
        weights = random(2, 32, 40, 3, seed=3)

        def by_lights(vertices, base, metallic, roughness):
            material = {"specular": (0.04 + (base - 0.04) * metallic)[None], "shininess": 2 / roughness**4 - 1}
            point = torch.cat((lamps, light.expand(2, 3), light.expand(2, 3)), 1)[:, None]
            lights = {"ambient": torch.zeros(3), "point": point}
            return renderer(vertices, faces, views, intrinsics, colors=(base * (1 - metallic)).expand(len(vertices), 3),
                                   materials=material, lights=lights)[..., :3]

        def by_formula(vertices, base, metallic, roughness):
            samples = renderer.rasterize(vertices, faces, views, intrinsics)
            position = samples.interpolate(vertices.expand(2, -1, -1))
            normal = shading.unit(samples.interpolate(shading.vertex_normals(vertices, faces).expand(2, -1, -1)))
            to_eye, to_lamp = (shading.unit(at[:, None, None] - position) for at in (eyes, lamps))
            shares = shading.metallic_roughness(normal, to_eye, to_lamp, base, metallic, roughness)
            return samples.resolve(math.pi * light * shares * samples.mask[..., None])

        for values in ((0.0, 1.0), (0.7, 0.4), (1.0, 0.55)):
            images, gradients = [], []
            for draw in (by_lights, by_formula):
                tensors = [vertices.clone(), torch.tensor([0.9, 0.5, 0.1]), *(torch.tensor([value]) for value in values)]
                tensors = [tensor.requires_grad_() for tensor in tensors]
                images.append(draw(*tensors))
                gradients.append(torch.autograd.grad((images[-1] * weights).sum(), tensors))
            self.assertGreater(images[1].detach().amax(), 0.2)
            torch.testing.assert_close(images[0], images[1], atol=1e-4, rtol=0)
            for found, expected in zip(*gradients):
                self.assertLess((found - expected).norm(), 5e-4 * expected.norm(), (values, found.shape))


class EnvironmentTest(unittest.TestCase):
    def image(self, height=64):
        """Smooth light, that differs in every direction."""
        down = (torch.arange(height) + 0.5)[:, None] / height * math.pi
        across = ((torch.arange(2 * height) + 0.5)[None, :] / (2 * height) - 0.5) * 2 * math.pi
        axes = torch.broadcast_tensors(down.sin() * across.sin(), down.cos(), -down.sin() * across.cos())
        return 1 + 0.6 * torch.stack(axes, -1) + 0.3 * (axes[1] * axes[0])[..., None]

    def test_directions(self):
        environment = shading.Environment(self.image())
        points, _ = directions(500)
        x, y, z = points.T
        wanted = 1 + 0.6 * torch.stack((x, y, z), -1) + 0.3 * (x * y)[:, None]
        self.assertLess((environment.light(points) - wanted).abs().max(), 0.01)
        # The mean of 1 + a y by the cosine is 1 + 2/3 a y, of a product of two axes a quarter.
        blurred = 1 + 0.4 * torch.stack((x, y, z), -1) + 0.075 * (x * y)[:, None]
        self.assertLess((environment.diffuse(points) - blurred).abs().max(), 0.01)

    def test_against_sums_of_all_directions(self):
        """Even light has one approximation, of the diffuse part; uneven light that of Karis' means too."""
        uneven, even = shading.Environment(self.image()), shading.Environment(torch.ones(8, 16, 3))
        color = torch.tensor([0.8, 0.5, 0.3])
        for degrees, metallic, roughness, error in ((0, 1.0, 0.4, 0.03), (0, 0.0, 0.8, 0.02), (20, 1.0, 0.25, 0.02),
                                                    (40, 0.3, 0.4, 0.02), (60, 0.0, 0.5, 0.03), (40, 1.0, 0.6, 0.15)):
            arguments = at_angle(degrees), color, metallic, roughness
            for environment, most in ((even, 0.02), (uneven, error)):
                wanted, found = reflected(environment.light, *arguments), environment.shade(UP, *arguments)
                self.assertLess(((found - wanted) / wanted).abs().max(), most, (degrees, metallic, roughness))

    def test_a_mirror_shows_the_image(self):
        environment = shading.Environment(random(32, 64, 3))
        points, _ = directions(50)
        torch.testing.assert_close(environment.specular(points, 0.0), environment.light(points))

    def test_gradients(self):
        image = random(8, 16, 3).double().requires_grad_()
        tensors = [shading.unit(random(4, 3, seed=k) + 0.1).double().requires_grad_() for k in (1, 2)]
        tensors.append((0.2 + 0.6 * random(4, 1, seed=3)).double().requires_grad_())
        color = torch.tensor([0.8, 0.5, 0.3]).double()
        environment = shading.Environment(image)
        self.assertTrue(torch.autograd.gradcheck(lambda *given: environment.shade(*given[:2], color, 0.5, given[2]), tensors,
                                                 atol=1e-4, rtol=1e-3))
        total = environment.shade(*tensors[:2], color, 0.5, tensors[2]).sum()
        total.backward()  # linear in the image
        self.assertAlmostEqual(float((image.grad * image).sum()), float(total.detach()), 6)
        environment = shading.Environment(image.detach())
        for value in (0.0, 0.2, 0.4, 0.5, 0.9, 1.0):  # between two levels, and at one
            rough = torch.tensor(value, requires_grad=True)
            environment.specular(tensors[0].detach(), rough).sum().backward()
            ends = [torch.tensor(min(max(value + step, 0), 1)) for step in ((-1e-3, 0) if value == 1 else (0, 1e-3))]
            change = [environment.specular(tensors[0].detach(), end).sum() for end in ends]
            self.assertAlmostEqual(float(rough.grad), float((change[1] - change[0]).detach()) / 1e-3, delta=1e-2)

    def test_poles(self):
        """The image's columns meet there, each with a colour of its own."""
        image = random(8, 16, 3)
        environment, poles = shading.Environment(image), torch.stack((UP, -UP))
        torch.testing.assert_close(environment.light(poles), torch.stack((image[0].mean(0), image[-1].mean(0))))
        around, _ = directions(200)
        near = shading.unit(poles[:, None] + 1e-3 * around)
        self.assertLess((environment.light(near) - environment.light(poles)[:, None]).abs().max(), 0.01)
        for points in (poles, near, 0 * poles):
            points = points.clone().requires_grad_()
            for values in (environment.light(points), environment.diffuse(points), environment.specular(points, 0.3)):
                (grad,) = torch.autograd.grad(values.sum(), points)
                self.assertLess(grad.abs().max(), 50)  # three channels of up to 1, half a row of pi / 16, columns of pi / 8
            (grad,) = torch.autograd.grad(environment.shade(points, UP, torch.ones(3), 0.5, 0.5).sum(), points)
            self.assertTrue(grad.isfinite().all())

    def test_refusals(self):
        for image, message in ((random(8, 8, 3), r"\[8, 8, 3\]"), (random(8, 16, 4), r"\[8, 16, 4\]"),
                               (random(8, 16, 3).numpy(), "ndarray.*a tensor of PyTorch")):
            with self.assertRaisesRegex(ValueError, r"image \(dpr.shading\): got " + message + r".*\[H, 2 H, 3\]"):
                shading.Environment(image)
        with self.assertRaisesRegex(ValueError, r"image \(dpr.shading\): got numbers that are not finite"):
            shading.Environment(torch.full((8, 16, 3), float("nan")))
        environment, rough = shading.Environment(random(8, 16, 3)), torch.tensor([[0.5], [math.nan]])
        for roughness in (math.nan, rough):
            for call in (lambda: environment.specular(UP.expand(2, 3), roughness),
                         lambda: environment.shade(UP.expand(2, 3), UP, torch.ones(3), 0.5, roughness)):
                with self.assertRaisesRegex(ValueError, r"roughness \(dpr.shading\): got NaN"):
                    call()
        with self.assertRaisesRegex(ValueError, "vertices.*a tensor of PyTorch"):
            shading.vertex_normals(random(4, 3).numpy(), torch.tensor([[0, 1, 2]]))


class SurfaceTest(unittest.TestCase):
    SQUARE = torch.tensor([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    FACES = torch.tensor([[0, 1, 2], [0, 2, 3]])

    def test_normals(self):
        normals = shading.vertex_normals(torch.stack((self.SQUARE, self.SQUARE.flip(-1))), self.FACES)
        torch.testing.assert_close(normals[0], torch.tensor([0.0, 0, 1]).expand(4, 3))
        torch.testing.assert_close(normals[1], torch.tensor([-1.0, 0, 0]).expand(4, 3))
        lonely = shading.vertex_normals(torch.cat((self.SQUARE, torch.ones(1, 3))), self.FACES)
        self.assertEqual(lonely[4].abs().max(), 0)

    def test_derivatives_of_normals(self):
        """The library's, beside those of PyTorch's operations: of doubles, along directions, and of gradients themselves."""
        def normals(vertices):
            return shading.vertex_normals(vertices, self.FACES)

        def by(vertices):
            vertices = vertices.clone().requires_grad_()
            grad, = torch.autograd.grad((normals(vertices) * weights.to(vertices)).sum(), vertices, create_graph=True)
            return grad, *torch.autograd.grad((grad * moved.to(vertices)).sum(), vertices)

        vertices, weights, moved = (torch.stack((self.SQUARE, self.SQUARE.flip(-1))) + random(2, 4, 3, seed=seed) for seed in range(3))
        exact, again = by(vertices.double())
        for found, wanted in zip(by(vertices), (exact, again)):
            torch.testing.assert_close(found, wanted.float(), rtol=1e-5, atol=1e-6)
        leaf = vertices.clone().requires_grad_()
        (normals(leaf) * weights).sum().backward()
        torch.testing.assert_close(leaf.grad, exact.float(), rtol=1e-5, atol=1e-6)
        _, along = torch.autograd.functional.jvp(normals, vertices.double(), moved.double())
        torch.testing.assert_close((along * weights).sum(), (exact * moved).sum())
        self.assertTrue(normals(vertices * 1e-8).norm(dim=-1).allclose(torch.ones(())))
        with self.assertRaisesRegex(ValueError, r"faces\[0\].*indices below 2"):
            shading.vertex_normals(vertices[0, :2], self.FACES)

    def test_tangents(self):
        texcoords = self.SQUARE[:, :2].clone()
        normal = torch.tensor([0.0, 0, 1])
        turn = torch.linalg.qr(random(3, 3, seed=9) - 0.5)[0]
        turn = turn * torch.det(turn)
        for mirror in (1.0, -1.0):
            tangents = shading.vertex_tangents(self.SQUARE, self.FACES, texcoords * torch.tensor([1, mirror]))
            torch.testing.assert_close(tangents, torch.tensor([[1.0, 0, 0, mirror]]).expand(4, 4))
            texels = torch.tensor([0.36, 0.48, 0.8])  # along u, along v, out
            mapped = shading.mapped_normals(normal, tangents[0], texels)
            torch.testing.assert_close(mapped, torch.tensor([0.36, 0.48 * mirror, 0.8]))
            turned = shading.vertex_tangents(self.SQUARE @ turn.T, self.FACES, texcoords * torch.tensor([1, mirror]))
            torch.testing.assert_close(shading.mapped_normals(turn @ normal, turned[0], texels), turn @ mapped,
                                       atol=1e-5, rtol=0)

    def test_texture_is_the_renderers(self):
        texture = random(5, 7, 3, seed=4)
        texcoords = 2.5 * random(4, 2, seed=5)
        view, intrinsics = dpr.look_at(torch.tensor([0.0, 0, 3])), dpr.perspective(30, 32, 32)
        renderer = dpr.Renderer(32, 32, sigma=1e-4)
        wanted = renderer(self.SQUARE, self.FACES, view, intrinsics, texcoords=texcoords, textures=[texture])
        samples = renderer.rasterize(self.SQUARE, self.FACES, view, intrinsics)
        image = samples.resolve(shading.texture_at(texture, samples.interpolate(texcoords)))
        self.assertLess((image - wanted[..., :3]).abs().max(), 1e-4)


class ShadowTest(unittest.TestCase):
    """A square of half the width s at height 1, over a floor; a light from above, so that the shadow is s^2 of the floor."""
    FLOOR = torch.tensor([[-2.0, 0, -2], [2, 0, -2], [2, 0, 2], [-2, 0, 2]])
    FACES = torch.tensor([[0, 2, 1], [0, 3, 2], [4, 6, 5], [4, 7, 6]])

    def shadow(self, size, spot, floor_throws):
        """Share of the floor that is dark."""
        sheet = self.FLOOR / 2 * size + UP
        vertices = torch.cat((self.FLOOR, sheet))
        view = dpr.look_at(torch.tensor([0.0, 4, 0]), up=torch.tensor([0.0, 0, -1]))
        camera = dpr.perspective(60, 96, 96) if spot else torch.tensor([[5.0]])
        renderer = dpr.Renderer(96, 96, blur=1.0, znear=1, zfar=8)
        light = shading.ShadowMap(renderer, vertices, self.FACES[0 if floor_throws else 2:], view, camera)
        line = (torch.arange(200) + 0.5) / 50 - 2
        x, z = torch.meshgrid(line, line, indexing="ij")
        points = torch.stack((x, torch.zeros_like(x), z), -1)
        visible = light.visibility(points)
        self.assertEqual(visible.shape, (200, 200, 1))
        top = light.visibility(torch.stack((0.9 * size * x / 4, torch.ones_like(x), 0.9 * size * z / 4), -1).detach())
        self.assertGreater(top.min(), 0.99)  # the sheet itself is lit
        return (1 - visible).mean()

    def test_area_and_its_derivative(self):
        for spot, scale, floor_throws in ((False, 1.0, True), (True, 4 / 3, True), (True, 4 / 3, False)):
            with self.subTest(spot=spot, floor_throws=floor_throws):
                size = torch.tensor(0.6, requires_grad=True)
                area = self.shadow(size, spot, floor_throws)
                side = 0.6 * scale / 2
                self.assertLess(abs(float(area) / side**2 - 1), 0.02)
                area.backward()
                self.assertLess(abs(float(size.grad) / (2 * side * scale / 2) - 1), 0.03)

    def test_outside_is_lit(self):
        renderer = dpr.Renderer(32, 32)
        view = dpr.look_at(torch.tensor([0.0, 4, 0]), up=torch.tensor([0.0, 0, -1]))
        light = shading.ShadowMap(renderer, self.FLOOR, self.FACES[:2], view, dpr.perspective(20, 32, 32))
        points = torch.tensor([[9.0, -1, 0], [0, 9, 0], [0, -1, 0]])
        self.assertTrue(torch.equal(light.visibility(points)[:2], torch.ones(2, 1)))
        self.assertLess(light.visibility(points)[2], 0.01)
        with self.assertRaisesRegex(ValueError, "intrinsics"):
            shading.ShadowMap(renderer, self.FLOOR, self.FACES, view, torch.zeros(1, 9))
        points[:, :2] *= 0.1  # all in sight, of an empty map
        for floor in (self.FLOOR + 100 * UP, self.FLOOR + torch.tensor([50.0, 0, 0])):
            with self.assertWarnsRegex(UserWarning, "every triangle was dropped"):
                nothing = shading.ShadowMap(renderer, floor, self.FACES[:2], view, dpr.perspective(20, 32, 32))
            self.assertTrue(torch.equal(nothing.visibility(points), torch.ones(3, 1)))


if __name__ == "__main__":
    unittest.main()
