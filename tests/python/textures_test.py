"""Textures, materials, and what views have by themselves, in the Python package `dpr`."""
import pickle
import sys
import unittest

try:
    import torch
except ImportError:
    print("skipped: no python3-torch")
    sys.exit(0)

import dpr
from package_test import (FACES, RELEASE, SIZE, SMOOTH, SQUARE, SQUARE_FACES, TETRAHEDRON, CompiledTest, RenderTest,
                          cameras, random)

MESH = (SQUARE, SQUARE_FACES)
LIGHTS = {"ambient": torch.tensor([0.2, 0.3, 0.4]), "point": torch.tensor([[2.0, 2.5, 4.0] + 3 * [0.5] + 3 * [0.4]])}
CORNERS = 2 * random(5, 3, 2, seed=5) - 0.5


def textured(seed=6):
    """Arguments with several textures and materials, each of a kind of its own."""
    textures = [random(5, 7, 3, seed=seed), random(4, 2, 3, seed=seed + 1)]
    return {"texcoords": CORNERS, "textures": textures, "face_textures": torch.tensor([0, 1, -1, 1, 0]),
            "wrap": ["mirror", "clamp"], "filter": ["trilinear", "bilinear"],
            "materials": {"specular": random(2, 3, seed=seed + 2), "shininess": torch.tensor([3.0, 8.0])},
            "face_materials": torch.tensor([0, 1, 1, 0, 1])}


def leaves(arguments):
    """The same with tensors of their own that need gradients, and these."""
    copy = dict(arguments)
    copy["texcoords"] = arguments["texcoords"].clone().requires_grad_()
    copy["textures"] = [texture.clone().requires_grad_() for texture in arguments["textures"]]
    copy["materials"] = {name: tensor.clone().requires_grad_() for name, tensor in arguments["materials"].items()}
    return copy, [copy["texcoords"], *copy["textures"], *copy["materials"].values()]


class TexturesTest(RenderTest):
    def assert_same_gradients(self, found, expected, tolerance=0.0):
        for tensor, other in zip(found, expected):
            self.assertGreater(other.grad.abs().sum(), 0)
            self.assert_same(tensor.grad, other.grad, tolerance)

    def test_every_pixel_is_its_texel(self):
        """A square that fills the image, of one texel a pixel, and beyond it on all sides."""
        square = torch.tensor([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]])
        faces = torch.tensor([[0, 1, 2], [0, 2, 3]])
        texcoords = torch.tensor([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
        texture = random(SIZE, SIZE, 3)
        views = cameras(1)[0]

        def image(**arguments):
            return dpr.render(square, faces, views, torch.tensor([[2.0]]), width=SIZE, height=SIZE, filter="nearest",
                              texcoords=texcoords, textures=texture, preset="gaussian", sigma=1e-9, gamma=1e-4,
                              **arguments)[0, ..., :3]

        inner = slice(1, -1)
        self.assert_same(image()[inner, inner], texture[inner, inner], 1e-5)
        self.assert_same(image(colors=0.5 * torch.ones(4, 3))[inner, inner], 0.5 * texture[inner, inner], 1e-5)
        texcoords = texcoords + 0.5  # half of the image to the right, half upwards
        whole = torch.arange(SIZE)
        places = {"repeat": lambda i: i % SIZE, "mirror": lambda i: torch.where(i < SIZE, i, 2 * SIZE - 1 - i),
                  "clamp": lambda i: i.clamp(max=SIZE - 1)}
        for wrap, place in places.items():
            columns, rows = place(whole + SIZE // 2), SIZE - 1 - place(SIZE - 1 - whole + SIZE // 2)
            self.assert_same(image(wrap=wrap)[inner, inner], texture[rows][:, columns][inner, inner], 1e-5)
        white = image(face_textures=torch.tensor([-1, 0]))
        self.assert_same(white[-3, -2], torch.ones(3), 1e-5)
        self.assert_same(white[1, 1], image()[1, 1])

    def test_materials_without_lights_have_gradients_of_0(self):
        arguments, tensors = leaves(textured())
        dpr.render(*MESH, *cameras(1), width=SIZE, height=SIZE, **arguments).sum().backward()
        for tensor in tensors[-2:]:
            self.assert_same(tensor.grad, torch.zeros_like(tensor))

    def test_gradients(self):
        views, intrinsics = cameras(2)
        arguments = textured()
        del arguments["textures"], arguments["materials"]
        # The grid of texels has kinks of its own: coordinates stay off it by more than the step.
        constants = {"vertices": SQUARE, "faces": SQUARE_FACES, "views": views, "intrinsics": intrinsics, **arguments,
                     "lights.point": LIGHTS["point"], "filter": "bilinear"}
        texels = {f"textures.{i}": texture for i, texture in enumerate(textured()["textures"])}
        materials = {f"materials.{name}": tensor for name, tensor in textured()["materials"].items()}
        lights = {"lights.ambient": torch.tensor([[0.2, 0.3, 0.4], [0.5, 0.3, 0.1]])}
        self.check_gradients(SMOOTH, {**texels, **materials, **lights}, constants)
        for word in ("blinn", "microfacet"):
            self.check_gradients({**SMOOTH, "shading": word}, {**texels, **materials, **lights},
                                 {**constants, "filter": "trilinear"})
        smooth = {"textures.0": torch.stack((torch.linspace(0, 1, 9).repeat(9, 1),) * 3, 2), "wrap": "clamp"}
        inside = 0.2 + 0.5 * random(5, 2, seed=8)
        constants = {"vertices": SQUARE, "faces": SQUARE_FACES, "views": views, "intrinsics": intrinsics, **smooth}
        self.check_gradients(SMOOTH, {"texcoords": inside}, constants)

    def test_forms_of_coordinates(self):
        views, intrinsics = cameras(1)
        settings = {"width": SIZE, "height": SIZE, "textures": random(6, 5, 3)}
        of_vertices = random(5, 2, seed=4).requires_grad_()
        indexed = torch.cat((torch.zeros(1, 2), of_vertices.detach())).requires_grad_()
        of_corners = of_vertices.detach()[SQUARE_FACES].clone().requires_grad_()
        forms = ((of_vertices, None), (indexed, (SQUARE_FACES + 1).int()), (of_corners, None))
        images = [dpr.render(*MESH, views, intrinsics, texcoords=texcoords, face_texcoords=indices, **settings)
                  for texcoords, indices in forms]
        sum(image.square().sum() for image in images).backward()
        for image in images[1:]:
            self.assert_same(image, images[0])
        self.assertGreater(of_vertices.grad.abs().sum(), 0)
        self.assert_same(indexed.grad[1:], of_vertices.grad, 1e-6)
        summed = torch.zeros(5, 2).index_add(0, SQUARE_FACES.flatten(), of_corners.grad.view(-1, 2))
        self.assert_same(summed, of_vertices.grad, 1e-5)

    def test_views_with_textures_and_lights_of_their_own(self):
        views, intrinsics = cameras(3)
        renderer = dpr.Renderer(SIZE, SIZE, **SMOOTH)
        arguments = {"colors": random(3, 5, 3), "texcoords": CORNERS, "wrap": "repeat"}
        vertices = SQUARE.repeat(3, 1, 1) + 0.1 * random(3, 5, 3, seed=9)
        own = {"ambient": random(3, 3), "point": random(3, 2, 9, seed=2) + 1, "harmonics": random(3, 9, 3, seed=3),
               "spot": torch.tensor([[1.0, 2.0, 3.0, -1.0, -2.0, -3.0, 40.0, 10.0, 0.5, 0.6, 0.7, 0.3, 0.2, 0.1]])}

        def calls():
            given = [tensor.clone().requires_grad_() for tensor in (vertices, random(3, 6, 5, 3), random(4, 4, 3),
                                                                    *own.values())]
            return given, {**arguments, "textures": given[1:3]}, dict(zip(own, given[3:]))

        found, surface, lights = calls()
        face_textures = torch.tensor([0, 1, 0, 1, 0])
        images = renderer(found[0], SQUARE_FACES, views, intrinsics, lights=lights, face_textures=face_textures,
                          **surface)
        alone, surface, lights = calls()

        def of_view(i):
            its_surface = {**surface, "textures": [surface["textures"][0][i], surface["textures"][1]],
                           "colors": arguments["colors"][i]}
            its_lights = {name: tensor if name == "spot" else tensor[i] for name, tensor in lights.items()}
            return renderer(alone[0][i], SQUARE_FACES, views[i:i + 1], intrinsics[i:i + 1], lights=its_lights,
                            face_textures=face_textures, **its_surface)

        expected = torch.cat([of_view(i) for i in range(3)])
        self.assert_same(images, expected)
        for batch in (images, expected):
            (batch * random(*batch.shape, seed=7)).sum().backward()
        self.assert_same_gradients(found, alone, 1e-5)
        one = renderer(SQUARE[None], SQUARE_FACES, views, intrinsics, lights={"ambient": own["ambient"]})
        shared = renderer(*MESH, views, intrinsics)
        self.assert_same(one[..., :3], shared[..., :3] * own["ambient"][:, None, None], 1e-6)

    def test_sampled_noise_is_of_the_view(self):
        views, intrinsics = cameras(2)
        renderer = dpr.Renderer(SIZE, SIZE, **SMOOTH, estimator="monte_carlo", samples=4)
        shared = renderer(*MESH, views, intrinsics, lights={"ambient": torch.ones(3)})
        self.assert_same(renderer(*MESH, views, intrinsics, lights={"ambient": torch.ones(2, 3)}), shared)

    def test_meshes_that_differ(self):
        views, intrinsics = cameras(3)
        renderer = dpr.Renderer(SIZE, SIZE, **SMOOTH)
        other = {"texcoords": random(4, 2), "textures": [random(3, 3, 3)], "wrap": "clamp"}

        def calls():
            first, tensors = leaves(textured())
            second = [other["texcoords"].clone().requires_grad_(), other["textures"][0].clone().requires_grad_()]
            return first, {**other, "texcoords": second[0], "textures": second[1]}, tensors + second

        lights = {**LIGHTS, "ambient": random(3, 3)}
        first, second, found = calls()
        lists = {name: [first.get(name), second.get(name), None] for name in first}
        lists["filter"], lists["wrap"][2] = [first["filter"], "bilinear", "bilinear"], "repeat"
        vertices, faces = [SQUARE, TETRAHEDRON, TETRAHEDRON], [SQUARE_FACES, FACES, FACES]
        images = renderer(vertices, faces, views, intrinsics, lights=lights, **lists)
        first, second, alone = calls()
        expected = torch.cat([
            renderer(v, f, views[i:i + 1], intrinsics[i:i + 1], lights={**lights, "ambient": lights["ambient"][i]}, **s)
            for i, (v, f, s) in enumerate(zip(vertices, faces, (first, second, {})))])
        self.assert_same(images, expected)
        (images.square().sum() + expected.square().sum()).backward()
        self.assert_same_gradients(found, alone)
        with self.assertRaisesRegex(ValueError, "texcoords .* got Tensor, expected a list of 3"):
            renderer(vertices, faces, views, intrinsics, textures=random(4, 4, 3), texcoords=random(4, 2))

    def test_padded_meshes(self):
        views, intrinsics = cameras(2)
        renderer = dpr.Renderer(SIZE, SIZE, **SMOOTH)
        pad = torch.nn.utils.rnn.pad_sequence
        textures, vertices, faces = random(2, 4, 4, 3), [TETRAHEDRON, SQUARE], [FACES, SQUARE_FACES]
        of_vertices, of_corners = [random(4, 2), random(5, 2)], [random(4, 3, 2), random(5, 3, 2)]
        of_faces = [torch.tensor([0, -1, 0, 0]), torch.tensor([0, 0, -1, 0, 0])]
        padded = (pad(vertices, batch_first=True), pad(faces, batch_first=True, padding_value=-1))
        for form, indices in ((of_vertices, None), (of_corners, None), (of_vertices, faces)):
            listed = renderer(vertices, faces, views, intrinsics, texcoords=form, face_texcoords=indices,
                              textures=textures, face_textures=of_faces)
            given = {"texcoords": pad(form, batch_first=True), "textures": textures,
                     "face_textures": pad(of_faces, batch_first=True)}
            if indices:
                given["face_texcoords"] = padded[1]
            self.assert_same(renderer(*padded, views, intrinsics, **given), listed)
        self.assertGreater((listed - renderer(vertices, faces, views, intrinsics)).abs().max(), 0.1)

    def test_kept_renderers_take_new_numbers(self):
        """Not those of the last call with such a mesh, nor its modes."""
        views, intrinsics = cameras(1)

        def image(seed, **change):
            return dpr.render(*MESH, views, intrinsics, width=SIZE, height=SIZE, lights=LIGHTS,
                              **{**textured(seed), **change})

        expected = image(6)
        for other in (image(20), image(6, wrap="repeat"), image(6, filter="nearest"),
                      image(6, face_textures=torch.tensor([0, 1, -1, 0, 0])),
                      image(6, materials=None, face_materials=None), image(6, texcoords=CORNERS + 0.1)):
            self.assertGreater((other - expected).abs().max(), 1e-3)
            self.assert_same(image(6), expected)

    def test_pickled_and_copied(self):
        views, intrinsics = cameras(1)
        renderer = dpr.Renderer(SIZE, SIZE, **SMOOTH)
        expected = renderer(*MESH, views, intrinsics, lights=LIGHTS, **textured())
        other = pickle.loads(pickle.dumps(renderer))
        self.assert_same(other(*MESH, views, intrinsics, lights=LIGHTS, **textured(), copy=True), expected)
        meta = {"textures": random(4, 4, 3).to("meta"), "texcoords": CORNERS.to("meta"),
                "face_textures": torch.zeros(5, dtype=torch.int64, device="meta")}
        good = {"textures": random(4, 4, 3), "texcoords": CORNERS}
        for name, tensor in meta.items():
            with self.assertRaisesRegex(ValueError, name + ".* got a tensor on meta, expected one on the CPU"):
                renderer(*MESH, views, intrinsics, **{**good, name: tensor})
            with self.assertRaises(NotImplementedError):  # of torch: there is nothing to copy
                renderer(*MESH, views, intrinsics, **{**good, name: tensor}, copy=True)

    def test_uv_is_an_output(self):
        views, intrinsics = cameras(2)
        wall, faces = torch.tensor([[-9.0, -9.0, 0.0], [9.0, -9.0, 0.0], [0.0, 9.0, 0.0]]), FACES[:1]
        corners = torch.tensor([[0.0, 0.0], [1.0, 0.0], [0.5, 2.0]])
        _, outputs = dpr.render(wall, faces, views, intrinsics, width=SIZE, height=SIZE, texcoords=corners,
                                textures=random(2, 2, 3), outputs=["uv", "barycentrics"])
        self.assert_same(outputs["uv"], outputs["barycentrics"] @ corners, 1e-5)
        with self.assertRaisesRegex(RuntimeError, "outputs .* got uv of a mesh without texture coordinates"):
            dpr.render(wall, faces, views, intrinsics, width=SIZE, height=SIZE, outputs=["uv"])

    def test_wrong_arguments(self):
        views, intrinsics = cameras(2)
        good = {**textured(), "lights": LIGHTS, "width": SIZE, "height": SIZE}
        expected = dpr.render(*MESH, views, intrinsics, **good)
        texture = random(4, 4, 3)
        wrong = [
            (ValueError, r"textures\[0\] .* got \[4, 3\], expected \[H, W, 3\]", {"textures": texture[0]}),
            (TypeError, r"textures\[1\] .* got uint8, expected float32", {"textures": [texture, texture.byte()]}),
            (TypeError, r"textures\[0\] .* got str", {"textures": "wood.png"}),
            (ValueError, r"textures .* got \[3, 4, 4, 3\], expected 2 in the first", {"textures": random(3, 4, 4, 3)}),
            (RuntimeError, r"textures\[0\] .* got 0", {"textures": [texture[:0], texture]}),
            (RuntimeError, "finite", {"textures": [texture / 0, texture]}),
            (RuntimeError, "face_textures.* got texture 1",
             {"textures": texture, "wrap": "clamp", "filter": "nearest"}),
            (RuntimeError, "textures .* got none beside texcoords", {"textures": None}),
            (RuntimeError, "texcoords .* got none beside textures", {"texcoords": None}),
            (ValueError, r"texcoords .* got \[3, 2\], expected \[5, 2\] or \[5, 3, 2\]", {"texcoords": CORNERS[0]}),
            (ValueError, r"texcoords .* got \[5, 3, 2\], expected \[T, 2\]", {"face_texcoords": SQUARE_FACES}),
            (ValueError, "face_texcoords .* got them alone", {"texcoords": None, "face_texcoords": SQUARE_FACES}),
            (RuntimeError, "face_texcoords.* got texture coordinate 4",
             {"texcoords": CORNERS[0], "face_texcoords": SQUARE_FACES}),
            (TypeError, "face_texcoords .* float32", {"texcoords": CORNERS[0], "face_texcoords": SQUARE_FACES.float()}),
            (ValueError, r"face_textures .* got \[3\], expected \[5\]",
             {"face_textures": torch.zeros(3, dtype=torch.int32)}),
            (RuntimeError, "face_textures .* got -2, expected indices from -1",
             {"face_textures": torch.tensor([0, 0, 0, 0, -2])}),
            (RuntimeError, "face_materials .* got -1, expected indices from 0",
             {"face_materials": torch.tensor([0, 0, 0, 0, -1])}),
            (RuntimeError, "face_materials.* got material 0",
             {"materials": None, "face_materials": torch.zeros(5).long()}),
            (RuntimeError, "wrap .* got \"tile\", expected repeat, mirror or clamp", {"wrap": "tile"}),
            (TypeError, "wrap .* got 1, expected a word", {"wrap": ["repeat", 1]}),
            (RuntimeError, "filter .* got 3 words, expected one", {"filter": ["nearest"] * 3}),
            (TypeError, "materials .* got Tensor, expected a dictionary", {"materials": torch.ones(1, 3)}),
            (TypeError, "lights .* got list, expected a dictionary", {"lights": [torch.ones(3)]}),
            (ValueError, "materials .* got 'diffuse', expected specular", {"materials": {"diffuse": torch.ones(1, 3)}}),
            (ValueError, r"materials.shininess .* got \[3\], expected \[2\]",
             {"materials": {"specular": torch.ones(2, 3), "shininess": torch.ones(3)}}),
            (RuntimeError, "shininess of materials.* got 0.5", {"materials": {"shininess": torch.tensor([0.5, 2.0])}}),
            (ValueError, r"lights.point .* got \[3, 1, 9\], expected .*\[2, L, 9\] of each view",
             {"lights": {"point": torch.ones(3, 1, 9)}}),
            (ValueError, r"lights.ambient .* got \[2, 4\]|\[4\], expected \[3\]",
             {"lights": {"ambient": torch.ones(2, 4)}}),
        ]
        for kind, words, change in wrong:
            with self.subTest(words), self.assertRaisesRegex(kind, words):
                dpr.render(*MESH, views, intrinsics, **{**good, **change})
        self.assert_same(dpr.render(*MESH, views, intrinsics, **good), expected)


@unittest.skipIf(RELEASE < (2, 4), "no torch.library.register_fake")
class CompiledTexturesTest(CompiledTest):
    def test_textures_and_lights_of_views(self):
        renderer = dpr.Renderer(SIZE, SIZE, shading="blinn")
        views, intrinsics = cameras(2)

        def loss(vertices, texture, of_views, ambient, specular):
            images, outputs = renderer(vertices, SQUARE_FACES, views, intrinsics, texcoords=CORNERS,
                                       textures=[texture, of_views], face_textures=torch.tensor([0, 1, -1, 1, 0]),
                                       filter=["trilinear", "nearest"], materials={"specular": specular},
                                       lights={**LIGHTS, "ambient": ambient}, outputs=["uv"])
            return (images[..., :3] * (1 + outputs["uv"].sum(-1, keepdim=True))).square().mean()

        self.check(loss, (SQUARE, random(5, 4, 3), random(2, 3, 3, 3), random(2, 3), random(1, 3)),
                   backend="aot_eager")

    def test_one_texture(self):
        views, intrinsics = cameras(2)

        def loss(texture, texcoords):
            return dpr.render(*MESH, views, intrinsics, width=SIZE, height=SIZE, textures=texture.sigmoid(),
                              texcoords=2 * texcoords).square().mean()

        self.check(loss, (random(5, 4, 3), random(5, 2)), backend="inductor")


if __name__ == "__main__":
    unittest.main(verbosity=2)
