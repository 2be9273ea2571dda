"""Files of meshes and images, and losses of shapes, in the Python package `dpr`."""
import os
import pathlib
import tempfile
import unittest
import warnings

import numpy as np

try:
    import torch
except ImportError:
    torch = None

import dpr

DATA = pathlib.Path(__file__).resolve().parents[2] / "bench/data"
QUARTER = {"views": dpr.look_at([[1.5, 1, 2.5]]), "intrinsics": dpr.perspective(44, 48, 48), "width": 48, "height": 48}


def octahedron():
    vertices = np.concatenate([np.eye(3), -np.eye(3)]).astype(np.float32)
    faces = np.array([[a, b, c] if (a < 3) == ((b < 3) == (c < 3)) else [a, c, b]
                      for a in (0, 3) for b in (1, 4) for c in (2, 5)])
    return vertices, faces


def moved(vertices, seed=0):
    return (vertices + 0.3 * np.random.default_rng(seed).normal(size=vertices.shape)).astype(np.float32)


class FilesTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)

    def test_textured_mesh_goes_through_a_file(self):
        """Arguments of render() are read; through a GLB, whose texels have 8 bits, the image stays."""
        mesh = dpr.read_mesh(DATA / "spot_control_mesh.obj")
        self.assertEqual(mesh["faces"].dtype, np.int64)
        self.assertEqual([mesh["wrap"], mesh["filter"], len(mesh["textures"])], [["repeat"], ["bilinear"], 1])
        image = dpr.render(**mesh, **QUARTER)
        self.assertGreater(np.ptp(image[..., :3][image[..., 3] > 0.9]), 0.3)
        dpr.write_mesh(self.folder / "spot.glb", **mesh)
        again = dpr.render(**dpr.read_mesh(str(self.folder / "spot.glb")), **QUARTER)
        self.assertLess(np.abs(again - image).max(), 0.02)
        plain = dpr.render(mesh["vertices"], mesh["faces"], **QUARTER)
        self.assertGreater(np.abs(plain - image).max(), 0.2)

    def test_colours_go_through_files(self):
        vertices, faces = octahedron()
        colors = np.linspace(0, 1, vertices.size, dtype=np.float32).reshape(-1, 3)
        for name, places in (("mesh.obj", 6), ("mesh.ply", 2), ("mesh.glb", 6)):
            dpr.write_mesh(self.folder / name, vertices.tolist(), faces.astype(np.int32), colors=colors)
            found = dpr.read_mesh(self.folder / name)
            for key, values, error in (("vertices", vertices, 1e-6), ("colors", colors, 10.0**-places)):
                np.testing.assert_allclose(found[key][found["faces"]], values[faces], atol=error)

    def test_texture_coordinates_go_through_files(self):
        """Those of vertices, of corners, and with indices, without textures."""
        vertices, faces = octahedron()
        of_corners = np.random.default_rng(1).random((len(faces), 3, 2), np.float32)
        indices = np.arange(24)[::-1].reshape(-1, 3)
        for given, wanted in (({"texcoords": vertices[:, :2]}, vertices[faces][..., :2]),
                              ({"texcoords": of_corners}, of_corners),
                              ({"texcoords": of_corners.reshape(-1, 2), "face_texcoords": indices},
                               of_corners.reshape(-1, 2)[indices])):
            dpr.write_mesh(self.folder / "mesh.obj", vertices, faces, **given)
            found = dpr.read_mesh(self.folder / "mesh.obj")
            np.testing.assert_array_equal(found["faces"], faces)
            np.testing.assert_allclose(found["texcoords"][found["face_texcoords"]], wanted, atol=1e-6)
            dpr.write_mesh(self.folder / "mesh.glb", vertices, faces, **given)
            self.assertIn(b"TEXCOORD_0", (self.folder / "mesh.glb").read_bytes())

    def test_what_is_left_out_is_a_warning(self):
        (self.folder / "mesh.obj").write_text("mtllib none.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl red\nf 1 2 3\n")
        with self.assertWarnsRegex(UserWarning, "none.mtl"):
            dpr.read_mesh(self.folder / "mesh.obj")
        (self.folder / "none.mtl").write_text("newmtl red\nKd 1 0 0\nKs 0.5 0.5 0.5\nNs 20\nillum 2\n")
        mesh = dpr.read_mesh(self.folder / "mesh.obj")
        np.testing.assert_allclose(mesh["materials"]["specular"], [[0.5] * 3])
        with self.assertWarnsRegex(UserWarning, "without materials"):
            dpr.write_mesh(self.folder / "mesh.glb", **mesh)
        del mesh["materials"]
        with self.assertWarnsRegex(UserWarning, "without opacities"):
            dpr.write_mesh(self.folder / "mesh.glb", **mesh, face_opacities=np.full(1, 0.5, np.float32))

    def test_images_go_through_files(self):
        image = np.random.default_rng(0).random((5, 7, 4), np.float32)
        dpr.write_image(self.folder / "image.exr", image)
        np.testing.assert_array_equal(dpr.read_image(self.folder / "image.exr"), image)
        dpr.write_image(self.folder / "image.png", image[..., :3].tolist())
        found = dpr.read_image(str(self.folder / "image.png"))
        np.testing.assert_allclose(found[..., :3], image[..., :3], atol=0.005)
        self.assertTrue((found[..., 3] == 1).all())
        raw = dpr.read_image(self.folder / "image.png", encoding="linear")[..., :3]
        np.testing.assert_allclose(np.where(raw <= 0.04045, raw / 12.92, ((raw + 0.055) / 1.055) ** 2.4), found[..., :3],
                                   atol=1e-5)
        (self.folder / "cut.png").write_bytes((self.folder / "image.png").read_bytes()[:60])
        for file, pixels, message in (("cut.png", None, "cut.png"), ("none.png", None, "none.png"), ("a.txt", image, "txt"),
                                      ("a.png", image[..., :2], r"\[5, 7, 2\]"), ("no/a.png", image, "no/a.png"),
                                      ("a.png", image[:0], "pixels")):
            with self.subTest(file=file, message=message), self.assertRaisesRegex((dpr.Error, ValueError), message):
                dpr.read_image(self.folder / file) if pixels is None else dpr.write_image(self.folder / file, pixels)
        with self.assertRaisesRegex(ValueError, "srgb or linear"):
            dpr.read_image(self.folder / "image.png", encoding="gamma")
        self.assertEqual(len(list(self.folder.iterdir())), 3)

    def test_errors_leave_no_file(self):
        vertices, faces = octahedron()
        with self.assertRaisesRegex(OSError, "none.obj"):
            dpr.read_mesh(self.folder / "none.obj")
        (self.folder / "cut.ply").write_bytes(b"ply\nformat ascii 1.0\nelement vertex 3\n")
        with self.assertRaisesRegex(dpr.IoError, "cut.ply"):
            dpr.read_mesh(self.folder / "cut.ply")
        os.remove(self.folder / "cut.ply")
        texture = {"texcoords": vertices[:, :2], "textures": np.zeros((2, 2, 3))}
        for name, arguments, message in (("a.obj", texture, "textures"), ("a.stl", {}, "stl"),
                                         ("a.obj", {"colors": vertices[1:]}, "colors"), ("no/a.obj", {}, "no/a.obj"),
                                         ("a.glb", {**texture, "wrap": "round"}, "wrap"),
                                         ("a.glb", {"textures": texture["textures"]}, r"texcoords \(dpr.write_mesh\)"),
                                         ("a.obj", {"texcoords": vertices[1:, :2]}, r"texcoords \(dpr.write_mesh\)"),
                                         ("a.PLY", {"texcoords": vertices[:, :2]}, r"texcoords \(dpr.write_mesh\).*obj or")):
            with self.subTest(name=name, message=message), self.assertRaisesRegex(dpr.Error, message):
                dpr.write_mesh(self.folder / name, vertices, faces, **arguments)
        with self.assertRaisesRegex(ValueError, "faces"):
            dpr.write_mesh(self.folder / "a.obj", vertices, faces + 1)
        self.assertEqual(list(self.folder.iterdir()), [])


class LossesTest(unittest.TestCase):
    TERMS = ("laplacian", "edge_length", "normal_consistency", "flatness")

    def test_values(self):
        """Numbers known beforehand: an octahedron, and a square folded along its diagonal."""
        vertices, faces = octahedron()
        loss = dpr.MeshLoss(faces)
        self.assertAlmostEqual(float(loss.laplacian(vertices)), 6, 5)  # each ring's mean is the middle
        self.assertAlmostEqual(float(loss.edge_length(vertices, 1.0)), (2**0.5 - 1) ** 2, 6)
        self.assertAlmostEqual(float(loss.normal_consistency(vertices)), 2 / 3, 6)
        self.assertAlmostEqual(float(loss.flatness(vertices)), 4 / 9, 6)
        square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], np.float32)
        for turn in ([0, 2, 3], [0, 3, 2]):  # a face's winding has no part in it
            self.assertAlmostEqual(float(dpr.MeshLoss([[0, 1, 2], turn]).normal_consistency(square)), 0, 6)
        three = dpr.MeshLoss([[0, 1, 2], [0, 1, 3], [0, 1, 4]])  # faces at one edge: as many hinges
        self.assertEqual(len(three._hinges), 3)

    def test_faces_without_area_and_lonely_vertices(self):
        vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [9, 9, 9]], np.float32)
        loss = dpr.MeshLoss([[0, 1, 2], [0, 1, 1]])
        for name in self.TERMS:
            self.assertTrue(np.isfinite(getattr(loss, name)(vertices)), name)
        self.assertEqual(loss.normal_consistency(vertices), 0)

    @unittest.skipUnless(torch, "no PyTorch")
    def test_gradients(self):
        vertices, faces = octahedron()
        vertices = torch.from_numpy(np.stack([moved(vertices, 1), moved(vertices, 2)])).double().requires_grad_()
        loss = dpr.MeshLoss(torch.from_numpy(faces))
        for name in self.TERMS:
            term = getattr(loss, name)
            self.assertTrue(torch.autograd.gradcheck(term, vertices, eps=1e-6, atol=1e-5), name)
            of_arrays = term(vertices.detach().numpy().astype(np.float32))
            np.testing.assert_allclose(term(vertices).detach().numpy(), of_arrays, rtol=1e-5)
        flat = torch.zeros(6, 3, requires_grad=True)
        sum(getattr(loss, name)(flat) for name in self.TERMS).backward()
        self.assertTrue(flat.grad.isfinite().all())

    def test_points_are_uniform(self):
        vertices = np.array([[0, 0, 0], [2, 0, 0], [0, 2, 0], [2, 0, 1], [2, 4, 1], [2, 0, 4]], np.float32)
        points = dpr.sample_points(vertices, [[0, 1, 2], [3, 4, 5]], 8000, seed=3)
        self.assertTrue((points == dpr.sample_points(vertices, [[0, 1, 2], [3, 4, 5]], 8000, seed=3)).all())
        first = points[points[:, 2] == 0]
        self.assertAlmostEqual(len(first) / len(points), 0.25, delta=0.02)
        np.testing.assert_allclose(first.mean(0), [2 / 3, 2 / 3, 0], atol=0.03)
        self.assertTrue((first[:, :2].sum(1) <= 2 + 1e-5).all())
        with self.assertRaisesRegex(ValueError, "area"):
            dpr.sample_points(np.zeros((3, 3), np.float32), [[0, 1, 2]], 5)
        for count in (0, 4, np.int64(5)):
            found = dpr.sample_points(vertices.tolist(), [[0, 1, 2], [3, 4, 5]], count, seed=3)
            self.assertEqual((found.shape, found.dtype), ((count, 3), np.float32))
            if torch:
                same = dpr.sample_points(torch.from_numpy(vertices), [[0, 1, 2], [3, 4, 5]], count, seed=3)
                np.testing.assert_allclose(same, found, atol=1e-6)
        for wrong, message in (((vertices[:, :2], [[0, 1, 2]], 5), r"vertices .*got \[6, 2\]"),
                               ((vertices, [0, 1, 2], 5), "faces"),
                               ((vertices, [[0, 1, -1]], 5), "faces .*from -1 to 1, expected indices from 0 to 5"),
                               ((vertices, [[0, 1, 6]], 5), "faces .*from 0 to 6"),
                               ((vertices, [[0, 1, 2]], -5), "count .*-5"),
                               ((vertices, [[0, 1, 2]], 1.5), "count .*1.5")):
            with self.assertRaisesRegex(ValueError, message + ".*expected" * ("expected" not in message)):
                dpr.sample_points(*wrong)

    def test_chamfer(self):
        a, b = moved(np.zeros((1500, 3)), 1), moved(np.zeros((1100, 3)), 2)
        squares = ((a[:, None] - b) ** 2).sum(-1)
        self.assertAlmostEqual(float(dpr.chamfer(a, b)), squares.min(1).mean() + squares.min(0).mean(), 6)
        self.assertAlmostEqual(float(dpr.chamfer(a.tolist(), b)), float(dpr.chamfer(a, b)), 6)
        away = np.float64([300, 0, -500])  # where sums of float32 have few digits for distances
        self.assertAlmostEqual(float(dpr.chamfer(a + away, b + away)) / float(dpr.chamfer(a, b)), 1, 6)
        shifted = [(points + away).astype(np.float32) for points in (a, b)]
        squares = ((shifted[0][:, None] - shifted[1]) ** 2).sum(-1)
        self.assertAlmostEqual(float(dpr.chamfer(*shifted)) / (squares.min(1).mean() + squares.min(0).mean()), 1, 6)
        for others, error in ((b[:, :2], ValueError), (b[:0], ValueError), ("b", TypeError)):
            with self.assertRaisesRegex(error, "others"):
                dpr.chamfer(a, others)
        if torch:
            points = torch.from_numpy(a[:9]).double().requires_grad_()
            self.assertTrue(torch.autograd.gradcheck(lambda x: dpr.chamfer(x, torch.from_numpy(b[:7]).double()), points))
            wanted, = torch.autograd.grad(dpr.chamfer(points, torch.from_numpy(b[:7]).double()), points)
            for pair in ((points, b[:7]), (b[:7], points)):  # beside NumPy's arrays
                np.testing.assert_allclose(torch.autograd.grad(dpr.chamfer(*pair), points)[0], wanted, rtol=1e-6)

    @unittest.skipUnless(torch, "no PyTorch")
    def test_deforms_a_sphere(self):
        """A mesh by its points alone, as PyTorch3D's tutorial fits one."""
        target = dpr.read_mesh(DATA / "fish_low.obj")
        vertices, faces = octahedron()
        for _ in range(3):
            middles = vertices[faces] + vertices[faces[:, [1, 2, 0]]]
            points, index = np.unique(np.round(middles.reshape(-1, 3), 5), axis=0, return_inverse=True)
            ab, bc, ca = (index.reshape(-1, 3) + len(vertices)).T
            a, b, c = faces.T
            faces = np.concatenate([np.stack(f, 1) for f in ((a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca))])
            vertices = np.concatenate([vertices, points / np.linalg.norm(points, axis=1, keepdims=True)])
        vertices = torch.tensor(0.5 * vertices, dtype=torch.float32, requires_grad=True)
        wanted = torch.from_numpy(dpr.sample_points(target["vertices"], target["faces"], 800, seed=0))
        loss, optimizer = dpr.MeshLoss(faces), torch.optim.Adam([vertices], 0.02)
        distances = []
        for step in range(60):
            optimizer.zero_grad()
            distance = dpr.chamfer(dpr.sample_points(vertices, faces, 800, seed=step), wanted)
            (distance + loss.edge_length(vertices) + 0.01 * loss.normal_consistency(vertices)).backward()
            optimizer.step()
            distances.append(float(distance))
        self.assertLess(distances[-1], 0.1 * distances[0])


if __name__ == "__main__":
    warnings.simplefilter("error", UserWarning)
    unittest.main()
