#!/usr/bin/env python3
"""Times a step of a descent in dpr and in other renderers, which take turns, round after round.

    python3 bench/report/peers.py [-o bench/results/peers.csv] [--python PEERS] [--rounds 10] [--only PROGRAM] [WORKLOAD...]
    python3 bench/report/peers.py --check bench/results/peers.csv README.md    or --write: the table's last column

A step sets new positions and colours of the vertices, renders the image, and leaves the gradients of a mean squared error
by positions and colours in the caller's arrays. Every program is a process that waits while another one runs. The file has
the fastest step of each, which other work on the machine disturbed least, and the median; it keeps its rows of
workloads and programs that are not measured.

Needs `dpr` and `dpr-bench` in the PATH and the package dpr. Takes DEODR and Mitsuba from the interpreter PEERS, since their
NumPy is newer than the one of Debian's PyTorch; programs that are not installed are left out. peers.sh does all this.
"""
import argparse
import csv
import datetime
import json
import os
import pathlib
import platform
import re
import statistics
import subprocess
import sys
import tempfile
import time

try:
    import numpy as np
except ImportError:  # which --check does not need
    np = None

FIELD_OF_VIEW, BACKGROUND, TARGET = 60.0, 0.0, 0.3
WORKLOADS = {"cube128": (0, 128, 6.7), "sphere256": (3, 256, 2.7), "sphere20k": (5, 256, 2.7),
             "sphere80k": (6, 512, 2.7), "million": (8, 1024, 2.7)}  # subdivisions, pixels, distance
# Memory that a step frees stays with the process; else DEODR spends half of a small step on pages from the system.
ALLOCATION = {"MALLOC_MMAP_THRESHOLD_": str(32 << 20), "MALLOC_TRIM_THRESHOLD_": str(4 << 30)}
STEPS = {"million": 2, "sphere80k": 4}  # of a turn; of the others 8


def icosphere(subdivisions):
    golden = (1 + 5**0.5) / 2
    points = np.array([(0, a, b * golden) for a in (-1, 1) for b in (-1, 1)], float)
    points = np.concatenate([np.roll(points, shift, axis=1) for shift in range(3)])
    points /= np.linalg.norm(points[0])
    edge = np.sort(np.linalg.norm(points[0] - points, axis=1))[1]
    near = np.abs(np.linalg.norm(points[:, None] - points, axis=2) - edge) < 1e-6
    faces = np.array([(a, b, c) for a in range(12) for b in range(a) for c in range(b)
                      if near[a, b] and near[b, c] and near[a, c]])
    # In the order of the C++ row's mesh: a face's parts follow each other, vertices their first face.
    for _ in range(subdivisions):
        sides = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
        edges, first, index = np.unique(sides, axis=0, return_index=True, return_inverse=True)
        order = np.argsort(first)
        middle = points[edges[order]].sum(axis=1)
        ab, bc, ca = (np.argsort(order)[index.ravel()].reshape(-1, 3) + len(points)).T
        a, b, c = faces.T
        faces = np.stack([np.stack(t, 1) for t in ((a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca))], 1).reshape(-1, 3)
        points = np.concatenate([points, middle / np.linalg.norm(middle, axis=1, keepdims=True)])
    return points, faces


def cube():
    points = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return points, np.array([t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))])


def outwards(points, faces):
    """Faces counterclockwise from outside, of a convex solid around the origin."""
    a, b, c = points[faces].transpose(1, 0, 2)
    inwards = np.einsum("ij,ij->i", np.cross(b - a, c - a), a) < 0
    faces[inwards] = faces[inwards][:, ::-1]
    return faces


class Work:
    """A workload's mesh and the shapes that its steps take in turn."""

    def __init__(self, name):
        subdivisions, self.size, self.distance = WORKLOADS[name]
        points, faces = icosphere(subdivisions) if subdivisions else cube()
        self.faces = outwards(points, faces)
        colors = (points / np.abs(points).max() + 1) / 2
        self.shapes = [(points + 2e-3 * np.sin(9 * np.roll(points, 1, axis=1) + phase),
                        colors * (1 - 2e-3 * (1 + np.sin(phase)))) for phase in range(4)]
        self.turn = 0

    def next_shape(self):
        self.turn += 1
        return self.shapes[self.turn % len(self.shapes)]


class Dpr:
    """The package with NumPy's arrays. Noise of the pixel: half a pixel."""

    def __init__(self, work):
        import dpr
        self.work = work
        work.shapes = [tuple(array.astype(np.float32) for array in shape) for shape in work.shapes]
        self.faces = work.faces.astype(np.int32)
        self.view = np.eye(4, dtype=np.float32)[None]
        self.view[0, 2, 3] = -work.distance
        focal = work.size / 2 / np.tan(np.radians(FIELD_OF_VIEW / 2))
        self.intrinsics = np.array([[focal, focal, work.size / 2, work.size / 2]], np.float32)
        self.renderer = dpr.Renderer(work.size, work.size, preset="pixel", sigma=1 / work.size**2)

    def step(self):
        vertices, colors = self.work.next_shape()
        start = time.perf_counter()
        image, pullback = self.renderer.vjp(vertices, self.faces, self.view, self.intrinsics, colors=colors,
                                            wrt=["vertices", "colors"])
        middle = time.perf_counter()
        pullback((2 / image.size) * (image - np.float32(TARGET)))
        return start, middle, time.perf_counter()


class DprTorch(Dpr):
    """The package with PyTorch's tensors."""

    def __init__(self, work):
        super().__init__(work)
        import torch
        work.shapes = [tuple(torch.from_numpy(array).requires_grad_() for array in shape) for shape in work.shapes]
        self.faces, self.view, self.intrinsics = map(torch.from_numpy, (self.faces, self.view, self.intrinsics))

    def step(self):
        vertices, colors = self.work.next_shape()
        vertices.grad = colors.grad = None
        start = time.perf_counter()
        image = self.renderer(vertices, self.faces, self.view, self.intrinsics, colors=colors)
        middle = time.perf_counter()
        (image - TARGET).square().mean().backward()
        return start, middle, time.perf_counter()


class Deodr:
    """DEODR: sharp images, silhouettes antialiased over a pixel, double precision, one core."""

    def __init__(self, work):
        from deodr import ColoredTriMesh
        from deodr.differentiable_renderer import PerspectiveCamera, Scene3D
        self.work = work
        self.mesh = ColoredTriMesh(work.faces.astype(np.uint32), work.shapes[0][0].copy(), clockwise=False, nb_colors=3)
        self.mesh.set_vertices_colors(work.shapes[0][1])
        self.camera = PerspectiveCamera(work.size, work.size, FIELD_OF_VIEW, np.array([0, 0, work.distance]),
                                        np.diag([1.0, -1.0, -1.0]))
        self.scene = Scene3D(sigma=1)
        self.scene.set_light(None, 1.0)
        self.scene.set_mesh(self.mesh)
        self.scene.set_background_color([BACKGROUND] * 3)

    def step(self):
        vertices, colors = self.work.next_shape()
        start = time.perf_counter()
        self.mesh.set_vertices(vertices)
        self.mesh.set_vertices_colors(colors)
        image = self.scene.render(self.camera)
        middle = time.perf_counter()
        self.scene.clear_gradients()
        self.scene.render_backward((2 / image.size) * (image - TARGET))
        return start, middle, time.perf_counter()


class Mitsuba:
    """Mitsuba's projective integrator, 16 samples a pixel."""

    def __init__(self, work):
        import drjit
        import mitsuba
        mitsuba.set_variant("llvm_ad_rgb")
        self.drjit, self.mitsuba = drjit, mitsuba
        points, colors = work.shapes[0]
        mesh = mitsuba.Mesh("mesh", len(points), len(work.faces))
        of_mesh = mitsuba.traverse(mesh)
        of_mesh["vertex_positions"] = mitsuba.Float(points.astype(np.float32).ravel())
        of_mesh["faces"] = mitsuba.UInt32(work.faces.astype(np.uint32).ravel())
        of_mesh.update()
        mesh.add_attribute("vertex_color", 3, colors.astype(np.float32).ravel())
        with tempfile.TemporaryDirectory() as folder:
            file = os.path.join(folder, "mesh.ply")
            mesh.write_ply(file)
            look = mitsuba.ScalarTransform4f().look_at([0, 0, work.distance], [0, 0, 0], [0, 1, 0])
            film = {"type": "hdrfilm", "width": work.size, "height": work.size, "rfilter": {"type": "box"}}
            self.scene = mitsuba.load_dict({
                "type": "scene",
                "integrator": {"type": "prb_projective", "max_depth": 2, "sppc": 16, "sppp": 16, "sppi": 0},
                "light": {"type": "constant"},
                "camera": {"type": "perspective", "fov": FIELD_OF_VIEW, "to_world": look, "film": film},
                "mesh": {"type": "ply", "filename": file, "bsdf": {
                    "type": "diffuse", "reflectance": {"type": "mesh_attribute", "name": "vertex_color"}}}})
        self.parameters = mitsuba.traverse(self.scene)
        self.keys = [key for key in self.parameters.keys() if key.endswith(("vertex_positions", "vertex_color"))]
        self.shapes = [[mitsuba.Float(array.astype(np.float32).ravel()) for array in shape] for shape in work.shapes]
        self.turn = 0

    def step(self):
        drjit = self.drjit
        self.turn += 1
        shape = self.shapes[self.turn % len(self.shapes)]
        start = time.perf_counter()
        for key in self.keys:
            self.parameters[key] = type(shape[0])(shape[0 if key.endswith("positions") else 1])
            drjit.enable_grad(self.parameters[key])
        self.parameters.update()
        image = self.mitsuba.render(self.scene, self.parameters, spp=16, seed=self.turn)
        loss = drjit.mean(drjit.square(image - TARGET), axis=None)
        drjit.eval(loss)
        drjit.sync_thread()
        middle = time.perf_counter()
        drjit.backward(loss)
        drjit.eval(*(drjit.grad(self.parameters[key]) for key in self.keys))
        drjit.sync_thread()
        return start, middle, time.perf_counter()


class DprBench:
    """The C++ library's own row of the same step, by dpr-bench."""

    def __init__(self, name):
        self.name = name

    def results(self, steps):
        with tempfile.TemporaryDirectory() as folder:
            file = pathlib.Path(folder, "row.json")
            subprocess.run(["dpr-bench", "--workload", self.name, "--preset", "pixel-sharp", "--stage", "rasterize",
                            "--repetitions", str(steps), "-o", file, "--quiet"], check=True)
            return json.loads(file.read_text())

    def turn(self, steps):
        row = self.results(steps)["results"][0]
        return list(zip(row["forward_ms"]["runs"], row["backward_ms"]["runs"]))


# Name, worker, package of its version, environment.
PROGRAMS = {
    "dpr C++": (None, "dpr", {}),
    "dpr C++ 1 thread": (None, "dpr", {"POCL_MAX_PTHREAD_COUNT": "1", "POCL_MAX_COMPUTE_UNITS": "1"}),
    "dpr NumPy": (Dpr, "dpr", {}),
    "dpr NumPy 1 thread": (Dpr, "dpr", {"POCL_MAX_PTHREAD_COUNT": "1", "POCL_MAX_COMPUTE_UNITS": "1"}),
    "dpr PyTorch": (DprTorch, "dpr", {}),
    "DEODR": (Deodr, "deodr", {}),
    "Mitsuba": (Mitsuba, "mitsuba", {}),
}


def serve(program):
    """A worker: reads a workload and a number of steps, answers with the milliseconds of each."""
    maker = PROGRAMS[program][0]
    made = {}
    answers = os.fdopen(os.dup(sys.stdout.fileno()), "w")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())  # what renderers print is no answer
    for line in sys.stdin:
        name, steps = json.loads(line)
        if maker is None:
            times = DprBench(name).turn(steps)
        else:
            if name not in made:
                made = {name: maker(Work(name))}
                made[name].step()
            times = []
            for _ in range(steps):
                start, middle, end = made[name].step()
                times.append((1e3 * (middle - start), 1e3 * (end - middle)))
        print(json.dumps(times), file=answers, flush=True)


def version_of(package, python):
    """None: not installed."""
    command = ["dpr", "--version"] if package == "dpr" else \
        [python, "-c", f"import importlib.metadata as m; print(m.version('{package}'))"]
    words = subprocess.run(command, capture_output=True, text=True, check=False).stdout.split()
    return words[-1] if words else None


def measure(programs, python, workloads, rounds):
    """Rows of the table."""
    workers = {}
    for program in programs:
        _, package, variables = PROGRAMS[program]
        command = [sys.executable if package == "dpr" else python, __file__, "--serve", program]
        workers[program] = subprocess.Popen(command, text=True, stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                                            env={**os.environ, **ALLOCATION, **variables})
    rows = []
    for name in workloads:
        times = {program: [] for program in programs}
        for _ in range(rounds):
            for program, worker in list(workers.items()):
                if program == "Mitsuba" and name not in ("cube128", "sphere256"):
                    continue  # minutes a step
                steps = 1 if program == "Mitsuba" else STEPS.get(name, 8)
                worker.stdin.write(json.dumps([name, steps]) + "\n")
                worker.stdin.flush()
                answer = worker.stdout.readline()
                if not answer:
                    print(f"{program} ended with status {worker.wait()} on {name}", file=sys.stderr)
                    del workers[program]
                    continue
                times[program] += json.loads(answer)
        for program, of_steps in times.items():
            if of_steps:
                forward, backward = min(of_steps, key=sum)
                median = statistics.median(map(sum, of_steps))
                rows.append((program, name, forward, backward, forward + backward, median, len(of_steps)))
                print(f"{name:10} {program:18} {forward:8.2f} + {backward:8.2f} ms, median {median:8.2f} ms", flush=True)
    for worker in workers.values():
        worker.stdin.close()
        worker.wait()
    return rows


def machine_of(programs):
    """The processor, and the OpenCL device on which dpr runs here, if it is one of the programs."""
    processor = next((line.split(":")[1].strip() for line in open("/proc/cpuinfo") if "model name" in line),
                     platform.processor())
    machine = f"{processor}, {os.cpu_count()} cores"
    if not any(PROGRAMS[program][1] == "dpr" for program in programs):
        return machine
    return f"{machine}; dpr on {DprBench('cube128').results(1)['device']['name']}"


def rows_of(results):
    return list(csv.DictReader(line for line in results.read_text().splitlines() if not line.startswith("#")))


def readme_with(results, text):
    """The document with the results' steps of two workloads in the last column of its table of programs."""
    steps = {(row["program"], row["workload"]): float(row["step_ms"]) for row in rows_of(results)}

    def cells(match):
        name = {"dpr": "dpr NumPy"}.get(match[2], match[2])
        figures = [f"{steps[name, workload]:,.{1 if steps[name, workload] < 10 else 0}f}"
                   if (name, workload) in steps else None for workload in ("sphere256", "million")]
        return f"{match[1]} {'; '.join(figure or '–' for figure in figures)} |" if any(figures) else match[0]

    return re.sub(r"^(\| (\w+) .*\|)[^|\n]*\|$", cells, text, flags=re.MULTILINE)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("workloads", nargs="*", metavar="WORKLOAD", help=f"of {', '.join(WORKLOADS)}")
    parser.add_argument("-o", "--output", type=pathlib.Path)
    parser.add_argument("--python", default=sys.executable, metavar="PEERS")
    parser.add_argument("--rounds", type=int, default=10)
    parser.add_argument("--only", action="append", choices=list(PROGRAMS), metavar="PROGRAM")
    parser.add_argument("--serve", help=argparse.SUPPRESS)
    for mode in ("--check", "--write"):
        parser.add_argument(mode, nargs=2, type=pathlib.Path, metavar=("RESULTS", "DOCUMENT"))
    options = parser.parse_args()
    if options.write:
        results, document = options.write
        return document.write_text(readme_with(results, document.read_text()))
    if options.check:
        results, document = options.check
        if readme_with(results, document.read_text()) != document.read_text():
            sys.exit(f"{document} differs from {results}; --write mends it")
        return None
    if options.serve:
        return serve(options.serve)
    unknown = set(options.workloads) - set(WORKLOADS)
    if unknown:
        parser.error(f"no such workload: {', '.join(sorted(unknown))}")
    versions = {program: version_of(PROGRAMS[program][1], options.python) for program in options.only or PROGRAMS}
    rows = measure([p for p in versions if versions[p]], options.python, options.workloads or list(WORKLOADS),
                   options.rounds)
    if options.output:
        columns = "program,version,workload,forward_ms,backward_ms,step_ms,median_ms,steps,date,load"
        made = f"{datetime.date.today()},{os.getloadavg()[0]:.1f}"
        lines = [f"{program},{versions[program]},{name},{','.join(f'{ms:.4g}' for ms in times)},{steps},{made}"
                 for program, name, *times, steps in rows]
        if options.output.exists():
            measured = {row[:2] for row in rows}
            lines += [",".join(row.values()) for row in rows_of(options.output)
                      if (row["program"], row["workload"]) not in measured]
        place = {(program, name): (i, k) for i, name in enumerate(WORKLOADS) for k, program in enumerate(PROGRAMS)}
        lines.sort(key=lambda line: place[line.split(",")[0], line.split(",")[2]])
        machine = machine_of({line.split(",")[0] for line in lines})
        head = (f"# {machine}. The fastest of the steps, between which the other programs took their turns, and the "
                "median.")
        options.output.write_text("\n".join([head, columns, *lines]) + "\n")


if __name__ == "__main__":
    main()
