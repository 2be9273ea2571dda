"""Five well-known samples of other differentiable renderers, over the Python package with PyTorch.

    PYTHONPATH=build/release/python /usr/bin/python3 bench/experiments/samples_of_peers.py SAMPLE FOLDER [--steps N] ...

Samples are written anew here, with the losses, weights, cameras and optimizers of the originals. `deform` takes 400 steps
unless told otherwise, SoftRas' demo 2000; this package renders the targets of `cow` and `camera` too. FOLDER is that of the
original's data, in a checkout of its repository on GitHub:

    hand    a hand, its pose, colour and light from a photograph   martinResearch/DEODR         deodr/data
    depth   a hand and its pose from a depth image                 martinResearch/DEODR         deodr/data
    deform  a sphere from 120 silhouettes                          ShichenLiu/SoftRas           data
    cow     a sphere and its colours from 20 views                 facebookresearch/pytorch3d   docs/tutorials/data/cow_mesh
    camera  a camera's place from a silhouette                     facebookresearch/pytorch3d   docs/tutorials/data

Prints the error in the original's measure and the milliseconds of a step, the median, and writes a picture: the target, the
start and the result, from left to right. --preset softras puts the model of SoftRas and PyTorch3D, noise of the triangles with
sigma = gamma = 1e-4, in place of noise on the pixel, and --blur sets the latter's width in pixels. --save FILE.npz keeps the
result of `hand` and `depth` in DEODR's units, for its own energy.
"""
import argparse
import os
import statistics
import time

import numpy as np
import torch

import dpr


def renderer_of(options, width, height):
    if options.preset == "pixel":
        return dpr.Renderer(width, height, blur=options.blur)
    return dpr.Renderer(width, height, preset=options.preset, sigma=1e-4, gamma=1e-4)


def read_mesh(folder, *names):
    mesh = dpr.read_mesh(os.path.join(folder, *names))
    return torch.from_numpy(mesh["vertices"]), torch.from_numpy(mesh["faces"]), mesh


def edges_of(faces):
    """[E, 2], each edge once."""
    return torch.from_numpy(np.unique(np.sort(faces.numpy()[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), 1), axis=0))


def sums_to_neighbours(values, edges):
    """Of each vertex, the sum of its neighbours' values minus its own."""
    across = values[edges[:, 1]] - values[edges[:, 0]]
    return torch.zeros_like(values).index_add(0, edges[:, 0], across).index_add(0, edges[:, 1], -across)


def run(options, step, report):
    """Takes steps, which return what is to be printed, and prints what the report says of the result."""
    times = []
    for count in range(options.steps):
        start = time.perf_counter()
        said = step(count)
        times.append(1e3 * (time.perf_counter() - start))
        if count % max(options.steps // 10, 1) == 0:
            print(f"step {count}: {said}", flush=True)
    print(f"{options.sample}: {report()}; {options.steps} steps, {statistics.median(times):.1f} ms each")


def write_pictures(options, *columns):
    """A row for each view of the columns' images [N, H, W] or [N, H, W, 3], as they are."""
    wide = [images.detach() if images.dim() == 4 else images.detach()[..., None].expand(-1, -1, -1, 3) for images in columns]
    picture = torch.cat([image for image in torch.cat(wide, 2)])
    dpr.write_image(options.picture or f"{options.sample}.png", picture.numpy(), encoding="linear")


def silhouettes_agree(alpha, target):
    """Mean intersection over union of views [N, H, W]."""
    alpha, target = alpha > 0.5, target > 0.5
    return float(((alpha & target).sum((1, 2)) / (alpha | target).sum((1, 2))).mean())


# DEODR's hands


class Hand:
    """DEODR's hand, its camera, and its descent: what changes has a speed, and steps are clamped."""

    def __init__(self, options, offset, focal, distortion, width, height):
        self.reference, self.faces, _ = read_mesh(options.folder, "hand.obj")
        self.mean = self.reference.mean(0)
        self.vertices = self.reference - self.mean
        self.edges = edges_of(self.faces)
        self.renderer = renderer_of(options, width, height)
        self.renderer.cull, self.renderer.shading = "back", "gouraud"
        radius = self.reference.std(0, unbiased=False).max()
        turn = torch.diag(torch.tensor([1.0, -1, -1]))
        place = self.mean + radius * torch.tensor(offset)
        matrix = torch.tensor([[focal, 0, width / 2], [0, focal, height / 2], [0, 0, 1]])
        self.camera = dpr.cameras.from_opencv(turn, -turn @ place, matrix, torch.tensor(distortion))

    def posed(self, quaternion, translation):
        """The vertices turned by a quaternion (x, y, z, w), and moved."""
        axis, real = (quaternion / quaternion.norm()).split([3, 1])
        across = torch.linalg.cross(axis.expand_as(self.vertices), self.vertices)
        twice = torch.linalg.cross(axis.expand_as(self.vertices), across)
        return self.vertices + 2 * (real * across + twice) + translation

    def rigidity(self):
        moved = sums_to_neighbours(self.vertices - self.reference, self.edges)
        return 500 * moved.square().sum()

    def fit(self, options, changing, image_of, target):
        """changing: name: (start, factor of the gradient, longest step). Returns the first and the last image."""
        values = {name: start.requires_grad_() for name, (start, _, _) in changing.items()}
        speeds = {name: torch.zeros_like(value) for name, value in values.items()}
        images, energies = [], []

        def energy():
            image = image_of(**values)
            return (image - target).square().sum(), self.rigidity(), image.detach()

        def step(_):
            with torch.no_grad():
                values["vertices"] -= values["vertices"].mean(0)
            data, rigid, image = energy()
            images.append(image)
            energies.append(float(data + rigid))
            gradients = torch.autograd.grad(data + rigid, list(values.values()))
            with torch.no_grad():
                for (name, value), gradient in zip(values.items(), gradients):
                    if name == "vertices":
                        gradient = gradient - gradient.mean(0)
                    _, factor, longest = changing[name]
                    speeds[name] = 0.95 * (0.96 * speeds[name] + 0.04 * (-factor * gradient).clamp(-longest, longest))
                    value += speeds[name]
                values["quaternion"] /= values["quaternion"].norm()
            return f"energy {energies[-1]:.1f}, {float(rigid):.1f} of it of the shape"

        def report():
            with torch.no_grad():
                data, rigid, image = energy()
            images.append(image)
            return (f"energy {energies[0]:.1f} at first, {float(data + rigid):.1f} at last, "
                    f"{float(rigid):.1f} of it of the shape")

        run(options, step, report)
        if options.save:
            np.savez(options.save, **{name: value.detach().numpy() for name, value in values.items()})
        return images[0], images[-1]


def hand(options):
    target = torch.from_numpy(dpr.read_image(os.path.join(options.folder, "hand.png"), encoding="linear")[..., :3])
    height, width, _ = target.shape
    fit = Hand(options, (0.0, 0.0, 9.0), 2.0 * width, (-1.0, 0, 0, 0, 0), width, height)

    def image_of(vertices, quaternion, translation, directional, ambient, color):
        fit.vertices = vertices
        light = torch.cat([directional, directional.norm().expand(3), torch.zeros(3)])
        return fit.renderer(fit.posed(quaternion, translation), fit.faces, *fit.camera, colors=color.expand(len(vertices), 3),
                            lights={"ambient": ambient.expand(3), "directional": light[None]},
                            background=torch.tensor([0.5, 0.6, 0.7]))[0, ..., :3]

    first, last = fit.fit(options, {
        "vertices": (fit.vertices, 5e-4, 0.5), "quaternion": (torch.tensor([0.0, 0, 0, 1]), 6e-5, 0.05),
        "translation": (fit.mean.clone(), 5e-5, 0.1), "directional": (torch.tensor([-0.1, -0.5, -0.4]), 1e-4, np.inf),
        "ambient": (torch.tensor(0.6), 1e-4, np.inf), "color": (torch.tensor([0.4, 0.3, 0.25]), 1e-5, np.inf),
    }, image_of, target)
    write_pictures(options, target[None], first[None], last[None])


def product(first, second):
    """The product of quaternions (x, y, z, w)."""
    (a, s), (b, t) = first.split([3, 1]), second.split([3, 1])
    return torch.cat([s * b + t * a + torch.linalg.cross(a, b), s * t - (a * b).sum(0, keepdim=True)])


def depth(options):
    target = np.fromfile(os.path.join(options.folder, "depth.bin"), np.float32).reshape(240, 320)[20:-20, ::-1][:, 60:-60]
    target = torch.from_numpy(np.where(target == 0, 450, target) / np.float32(450))
    height, width = target.shape
    fit = Hand(options, (-0.5, 0.0, 5.0), 241.0, (1.0, 0, 0, 0, 0), width, height)

    def image_of(vertices, quaternion, translation):
        fit.vertices = vertices
        samples = fit.renderer.rasterize(fit.posed(quaternion, translation), fit.faces, *fit.camera)
        scaled = torch.where(samples.mask, samples.depth * (110 / 450), samples.depth.new_ones(()))
        return samples.resolve(scaled[..., None])[0, ..., 0].clamp(0, 1)

    half = torch.tensor(0.05)  # of 0.1 radians about each axis, z first
    turns = [torch.eye(4)[axis] * half.sin() + torch.eye(4)[3] * half.cos() for axis in (0, 1, 2)]
    first, last = fit.fit(options, {
        "vertices": (fit.vertices, 5e-4, 1.0), "quaternion": (product(turns[0], product(*turns[1:])), 6e-5, 0.1),
        "translation": (torch.zeros(3), 5e-5, 0.1)}, image_of, target)
    write_pictures(options, target[None], first[None], last[None])


# SoftRas' silhouettes


def deform(options):
    target = torch.from_numpy(np.load(os.path.join(options.folder, "source.npy"))[:, 3].astype(np.float32) / 255)
    distance, elevation, azimuth = np.load(os.path.join(options.folder, "camera.npy")).astype(np.float32).T
    elevation, azimuth = np.radians(elevation), np.radians(azimuth)
    eyes = distance * np.stack([np.cos(elevation) * np.sin(azimuth), np.sin(elevation), -np.cos(elevation) * np.cos(azimuth)])
    size = target.shape[-1]
    cameras = dpr.cameras.from_softras(torch.from_numpy(eyes.T.copy()), size, viewing_angle=15)
    template, faces, _ = read_mesh(options.folder, "obj", "sphere", "sphere_1352.obj")
    template = template * 0.5
    displace, center = torch.zeros_like(template, requires_grad=True), torch.zeros(1, 3, requires_grad=True)
    terms, hinges = dpr.MeshLoss(faces), 1.5 * len(faces)
    renderer, rigid = renderer_of(options, size, size), dpr.Renderer(size, size, preset="rigid")
    adam = torch.optim.Adam([displace, center], 0.01, betas=(0.5, 0.99))
    base = torch.log(template.abs() / (1 - template.abs()))

    def vertices():
        middle = torch.tanh(center)
        shape = torch.sigmoid(base + displace) * torch.sign(template)
        return torch.relu(shape) * (1 - middle) - torch.relu(-shape) * (1 + middle) + middle

    def loss_of(shape):
        alpha = renderer(shape, faces, *cameras)[..., 3]
        both = alpha * target
        return 1 - (both.sum((1, 2)) / ((alpha + target - both).sum((1, 2)) + 1e-6)).mean()

    def step(_):
        shape = vertices()
        of_images = loss_of(shape)
        loss = of_images + 0.03 * terms.laplacian(shape) + 0.0003 * hinges * terms.flatness(shape)
        adam.zero_grad()
        loss.backward()
        adam.step()
        return f"loss {float(loss):.4f}, {float(of_images):.4f} of it of the images"

    def hard(shape):
        return rigid(shape, faces, *cameras)[..., 3].detach()

    def report():
        with torch.no_grad():
            shape = vertices()
            return (f"loss of the images {float(loss_of(shape)):.4f}, "
                    f"intersection over union of sharp images {silhouettes_agree(hard(shape), target):.4f}")

    first = hard(vertices())
    run(options, step, report)
    some = [0, 31, 62, 93, 104]
    write_pictures(options, target[some], first[some], hard(vertices())[some])


# PyTorch3D's tutorials


def icosphere(level):
    golden = (1 + 5**0.5) / 2
    corners = [[float(s), t * golden, 0.0] for s in (-1, 1) for t in (-1, 1)]
    vertices = torch.tensor([corner[shift:] + corner[:shift] for shift in range(3) for corner in corners])
    near = torch.cdist(vertices, vertices) < 2.1
    faces = torch.tensor([[i, j, k] for i in range(12) for j in range(i) for k in range(j)
                          if near[i, j] and near[j, k] and near[i, k]])
    a, b, c = vertices[faces].unbind(1)
    inwards = (torch.linalg.cross(b - a, c - a) * a).sum(1) < 0
    faces = torch.where(inwards[:, None], faces.flip(1), faces)
    for _ in range(level):
        edges = edges_of(faces)
        at = {tuple(edge): len(vertices) + i for i, edge in enumerate(edges.tolist())}
        vertices = torch.cat([vertices, vertices[edges].mean(1)])
        pieces = []
        for a, b, c in faces.tolist():
            ab, bc, ca = (at[min(pair), max(pair)] for pair in ((a, b), (b, c), (c, a)))
            pieces += [[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]
        faces = torch.tensor(pieces)
    return torch.nn.functional.normalize(vertices), faces


def cow(options):
    size, random = 128, np.random.default_rng(0)
    truth, truth_faces, mesh = read_mesh(options.folder, "cow.obj")
    truth = (truth - truth.mean(0)) / (truth - truth.mean(0)).abs().max()
    texture = dpr.read_image(os.path.join(options.folder, "cow_texture.png"), encoding="linear")[..., :3]
    elevation, azimuth = torch.linspace(0, 2 * np.pi, 20), torch.linspace(-np.pi, np.pi, 20)
    eyes = 2.7 * torch.stack([elevation.cos() * azimuth.sin(), elevation.sin(), elevation.cos() * azimuth.cos()], 1)
    views, lens = dpr.look_at(eyes), dpr.perspective(60, size, size)
    scene = {"background": torch.ones(3),
             "lights": {"ambient": torch.full((3,), 0.5), "point": torch.tensor([[0.0, 0, -3] + 3 * [0.3] + 3 * [0.2]])}}
    lens = torch.from_numpy(lens)
    renderer, rigid = renderer_of(options, size, size), dpr.Renderer(size, size, preset="rigid")
    textured = {"texcoords": torch.from_numpy(mesh["texcoords"]), "face_texcoords": torch.from_numpy(mesh["face_texcoords"]),
                "textures": [torch.from_numpy(texture.copy())]}
    target = rigid(truth, truth_faces, views, lens, **textured, **scene)
    silhouette = renderer(truth, truth_faces, views, lens)[..., 3]

    sphere, faces = icosphere(4)
    offsets, colors = torch.zeros_like(sphere, requires_grad=True), torch.full_like(sphere, 0.5, requires_grad=True)
    terms, edges = dpr.MeshLoss(faces), edges_of(faces)
    degrees = torch.bincount(edges.reshape(-1), minlength=len(sphere))[:, None]
    descent = torch.optim.SGD([offsets, colors], lr=1.0, momentum=0.9)

    def laplacian(vertices):
        """The mean distance to the mean of the neighbours, not squared as dpr.MeshLoss has it."""
        return (sums_to_neighbours(vertices, edges) / degrees).norm(dim=1).mean()

    def errors_of(image, some):
        return (image[..., 3] - silhouette[some]).square().mean(), (image - target[some])[..., :3].square().mean()

    def step(_):
        some, vertices = torch.from_numpy(random.permutation(20)[:2]), sphere + offsets
        image = renderer(vertices, faces, views[some], lens, colors=colors, **scene)
        of_images = errors_of(image, some)
        loss = sum(of_images) + terms.edge_length(vertices) + 0.01 * terms.normal_consistency(vertices) + laplacian(vertices)
        descent.zero_grad()
        loss.backward()
        descent.step()
        return f"loss {float(loss):.5f}: silhouettes {float(of_images[0]):.5f}, colours {float(of_images[1]):.5f}"

    @torch.no_grad()
    def images(renderer):
        return renderer(sphere + offsets, faces, views, lens, colors=colors, **scene)

    def report():
        soft, hard = images(renderer), images(rigid)
        errors = errors_of(soft, torch.arange(20))
        return (f"mean squared error of 20 silhouettes {float(errors[0]):.5f}, of colours {float(errors[1]):.5f}; "
                f"sharp images: colours {float((hard - target)[..., :3].square().mean()):.5f}, "
                f"intersection over union {silhouettes_agree(hard[..., 3], target[..., 3]):.4f}")

    first = images(rigid)
    run(options, step, report)
    some = [1, 6, 10, 15]
    write_pictures(options, *(of_all[some, ..., :3] for of_all in (target, first, images(rigid))))


def camera(options):
    size, tilt = 256, np.radians(50)
    vertices, faces, _ = read_mesh(options.folder, "teapot.obj")
    truth = torch.tensor([0, 3 * np.sin(tilt), 3 * np.cos(tilt)], dtype=torch.float32)
    lens = torch.from_numpy(dpr.perspective(60, size, size))
    target = dpr.Renderer(size, size, preset="rigid")(vertices, faces, dpr.look_at(truth), lens)[0, ..., 3]
    place = torch.tensor([3.0, 6.9, 2.5], requires_grad=True)
    renderer, adam, losses = renderer_of(options, size, size), torch.optim.Adam([place], lr=0.05), []

    def alpha():
        return renderer(vertices, faces, dpr.look_at(place), lens)[0, ..., 3]

    def error():
        return float((place.detach() - truth).norm())

    def step(_):
        adam.zero_grad()
        loss = (alpha() - target).square().sum()
        loss.backward()
        adam.step()
        losses.append(float(loss))
        return f"loss {losses[-1]:.1f}, the camera {error():.4f} from its place"

    def report():
        below = [step for step, loss in enumerate(losses) if loss < 200]  # where the tutorial ends
        return (f"loss {float((alpha() - target).square().sum()):.1f}, the camera {error():.4f} from its place; "
                f"below 200 {f'after {below[0]} steps' if below else 'never'}")

    first = alpha()
    run(options, step, report)
    write_pictures(options, target[None], first[None], alpha()[None])


SAMPLES = {"hand": (hand, 100, 0.7), "depth": (depth, 300, 0.7), "deform": (deform, 400, 0.35), "cow": (cow, 2000, 0.7),
           "camera": (camera, 200, 0.7)}

if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    samples = parser.add_subparsers(dest="sample", required=True)
    for name, (_, steps, blur) in SAMPLES.items():
        sample = samples.add_parser(name)
        sample.add_argument("folder", help="the original's data")
        sample.add_argument("--steps", type=int, default=steps, help=f"{steps} unless given")
        sample.add_argument("--blur", type=float, default=blur, help=f"pixels, {blur} unless given")
        sample.add_argument("--preset", default="pixel", help="of the smoothing")
        sample.add_argument("--picture", help="the picture's file")
        if name in ("hand", "depth"):
            sample.add_argument("--save", help="NPZ file of the result, in DEODR's units")
    given = parser.parse_args()
    SAMPLES[given.sample][0](given)
