#!/usr/bin/env python3
"""Writes textured.obj, textured.mtl, texture.png and what Mitsuba 3 makes of them, textured.exr: a cube that shines by
its texture, seen from (0, 0, 4) by a camera with 40 degrees over the height, each pixel the mean of its area.

    pip install mitsuba && python3 textured.py FOLDER
"""
import pathlib
import sys

import mitsuba
import numpy

WIDTH, HEIGHT, SAMPLES = 64, 48, 4096
# Counter-clockwise from outside.
SIDES = ((0, 1, 3, 2), (5, 4, 6, 7), (4, 0, 2, 6), (1, 5, 7, 3), (2, 3, 7, 6), (4, 5, 1, 0))


def rotation(degrees, axis):
    c, s = numpy.cos(numpy.radians(degrees)), numpy.sin(numpy.radians(degrees))
    k = numpy.array(axis) / numpy.linalg.norm(axis)
    cross = numpy.array(((0, -k[2], k[1]), (k[2], 0, -k[0]), (-k[1], k[0], 0)))
    return numpy.eye(3) + s * cross + (1 - c) * cross @ cross


def write_cube(folder):
    corners = [(x, y, z) for z in (1, -1) for y in (-1, 1) for x in (-1, 1)]
    turned = 0.8 * numpy.array(corners) @ rotation(37, (0.5, 0.8, 0.3)).T
    random = numpy.random.default_rng(1)
    lines = ["mtllib textured.mtl", "usemtl textured"]
    lines += ["v %.6f %.6f %.6f" % tuple(p) for p in turned]
    for side in SIDES:
        start, angle = random.uniform(-1, 1, 2), random.uniform(0, 360)
        for corner in ((0, 0), (1.7, 0), (1.7, 1.4), (0, 1.4)):  # beyond the texture, which repeats
            uv = start + (rotation(angle, (0, 0, 1)) @ (*corner, 0))[:2]
            lines.append("vt %.6f %.6f" % tuple(uv))
    for i, side in enumerate(SIDES):
        a, b, c, d = ("%d/%d" % (v + 1, 4 * i + k + 1) for k, v in enumerate(side))
        lines += [f"f {a} {b} {c}", f"f {a} {c} {d}"]
    (folder / "textured.obj").write_text("\n".join(lines) + "\n")
    (folder / "textured.mtl").write_text("newmtl textured\nmap_Kd texture.png\n")
    texels = random.integers(0, 256, (9, 12, 3), numpy.uint8)
    mitsuba.Bitmap(texels).write(str(folder / "texture.png"))


def main(folder):
    mitsuba.set_variant("scalar_rgb")
    write_cube(folder)
    scene = mitsuba.load_dict({
        "type": "scene",
        "integrator": {"type": "path", "max_depth": 1},
        "sensor": {
            "type": "perspective", "fov": 40, "fov_axis": "y",
            "to_world": mitsuba.ScalarTransform4f().look_at(origin=[0, 0, 4], target=[0, 0, 0], up=[0, 1, 0]),
            "film": {"type": "hdrfilm", "width": WIDTH, "height": HEIGHT, "rfilter": {"type": "box"}},
            "sampler": {"type": "multijitter", "sample_count": SAMPLES}},
        "cube": {
            "type": "obj", "filename": str(folder / "textured.obj"), "face_normals": True,
            "emitter": {"type": "area", "radiance": {
                "type": "bitmap", "filename": str(folder / "texture.png"), "filter_type": "bilinear",
                "wrap_mode": "repeat"}}}})
    image = mitsuba.Bitmap(mitsuba.render(scene))
    halves = image.convert(mitsuba.Bitmap.PixelFormat.RGB, mitsuba.Struct.Type.Float16, False)
    halves.write(str(folder / "textured.exr"))
    print("Mitsuba", mitsuba.__version__)


if __name__ == "__main__":
    main(pathlib.Path(sys.argv[1]))
