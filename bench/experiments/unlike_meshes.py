"""24 meshes of different topology through the Python package: one call, 24 calls, and 24 shapes of one of them; and 24 views
of one mesh, each in lights of its own.

    PYTHONPATH=build/release/python /usr/bin/python3 bench/experiments/unlike_meshes.py [FACES ...]

Prints milliseconds of an image and its gradient by the vertices, medians, at 128x128 pixels with noise of half a pixel;
with PyTorch, of dpr.nvdiffrast too: ranges of one list of triangles, and a call for each mesh. Vertices move from step to
step.
"""
import statistics
import sys
import time

import numpy as np

import dpr

try:
    import torch
    import dpr.nvdiffrast as dr
except ImportError:
    torch = None

COUNT, SIZE, ROUNDS, STEPS = 24, 128, 4, 5


def torus(rings, sectors):
    """(vertices, faces)"""
    turn, tube = np.meshgrid(2 * np.pi * np.arange(rings) / rings, 2 * np.pi * np.arange(sectors) / sectors, indexing="ij")
    radius = 0.7 + 0.3 * np.cos(tube)
    vertices = np.stack([radius * np.cos(turn), 0.3 * np.sin(tube), radius * np.sin(turn)], -1).reshape(-1, 3)
    ring, sector = np.meshgrid(np.arange(rings), np.arange(sectors), indexing="ij")

    def vertex(ring, sector):
        return ring % rings * sectors + sector % sectors

    a, b, c, d = (vertex(ring + i, sector + k) for i in (0, 1) for k in (0, 1))
    return vertices.astype(np.float32), np.stack([a, b, c, c, b, d], -1).reshape(-1, 3)


def nvdiffrast_ways(vertices, triangles, views):
    projection = np.array([[2, 0, 0, 0], [0, 2, 0, 0], [0, 0, -1.2, -2.2], [0, 0, -1, 0]])
    points = [torch.tensor(np.pad(mesh, ((0, 0), (0, 1)), constant_values=1) @ (projection @ view).T, dtype=torch.float32)
              for mesh, view in zip(vertices, views)]
    faces = [torch.tensor(own, dtype=torch.int32) for own in triangles]
    counts = torch.tensor([len(own) for own in faces], dtype=torch.int32)
    firsts = np.cumsum([0, *(len(own) for own in points)])
    joined = torch.cat([own + int(first) for own, first in zip(faces, firsts)])
    ranges, context = torch.stack([counts.cumsum(0) - counts, counts], 1).int(), dr.RasterizeCudaContext()

    def step(points, faces, ranges=None):
        points = (points + 1e-3 * float(np.random.default_rng().random())).requires_grad_()
        rast, _ = dr.rasterize(context, points, faces, [SIZE, SIZE], ranges=ranges)
        colors, _ = dr.interpolate(points.detach()[..., :3].contiguous(), rast, faces)
        dr.antialias(colors, rast, points, faces).square().sum().backward()

    return {"ranges": lambda: step(torch.cat(points), joined, ranges),
            f"{COUNT} antialiased images": lambda: [step(own[None], its) for own, its in zip(points, faces)]}


def measure(faces):
    side = max(int((faces / 2) ** 0.5), 5)
    meshes = [torus(side + i % 5 - 2, side + 7 * i % 5 - 2) for i in range(COUNT)]
    vertices, triangles = [list(of_all) for of_all in zip(*meshes)]
    views = dpr.look_at([[3 * np.sin(turn), 1, 3 * np.cos(turn)] for turn in np.linspace(0, 3, COUNT)])
    lens, random = dpr.perspective(40, SIZE, SIZE), np.random.default_rng(1)
    renderer, grad = dpr.Renderer(SIZE, SIZE, preset="pixel", blur=0.5), np.ones((COUNT, SIZE, SIZE, 4), np.float32)

    lights = {"ambient": 0.4 * random.random((COUNT, 3), np.float32), "point": 1 + random.random((COUNT, 2, 9), np.float32)}

    def step(vertices, triangles, views, **lit):
        image, pullback = renderer.vjp(vertices, triangles, views, lens, wrt=["vertices", *lit], **lit)
        pullback(grad[:len(image)])

    def moved(mesh):
        return mesh + np.float32(1e-3 * random.random())

    ways = {
        "one call": lambda: step([moved(mesh) for mesh in vertices], triangles, views),
        f"{COUNT} calls": lambda: [step(moved(mesh), own, views[i:i + 1])
                                   for i, (mesh, own) in enumerate(zip(vertices, triangles))],
        "shapes of one mesh": lambda: step(np.stack([moved(vertices[0]) for _ in range(COUNT)]), triangles[0], views),
        "lit views": lambda: step(moved(vertices[0]), triangles[0], views, lights=lights),
        f"{COUNT} lit calls": lambda: [step(moved(vertices[0]), triangles[0], views[i:i + 1],
                                            lights={name: array[i] for name, array in lights.items()}) for i in range(COUNT)],
    }
    if torch:
        ways.update(nvdiffrast_ways(vertices, triangles, views))
    times = {name: [] for name in ways}
    for _ in range(ROUNDS):
        for name, way in ways.items():
            way(), way()  # what the pool of renderers has let go is made again
            for _ in range(STEPS):
                start = time.perf_counter()
                way()
                times[name].append(1e3 * (time.perf_counter() - start))
    medians = {name: statistics.median(of_way) for name, of_way in times.items()}
    mean, listed = statistics.mean(map(len, triangles)), ", ".join(f"{name} {ms:.1f} ms" for name, ms in medians.items())
    pairs = (("one call", "calls"), ("lit views", "lit calls"), ("ranges", "antialiased images"))
    ratios = [medians[one] / medians[f"{COUNT} {many}"] for one, many in pairs if one in medians]
    print(f"{mean:.0f} faces: {listed}; one over {COUNT}: {', '.join(f'{ratio:.2f}' for ratio in ratios)}", flush=True)


for count in map(int, sys.argv[1:] or (144, 1600, 10000)):
    measure(count)
