"""The C interface from Python's ctypes: a triangle is moved towards its image. Argument: the shared library."""

import ctypes
import sys
from ctypes import byref, c_char_p, c_double, c_float, c_int, c_size_t, c_uint32, c_void_p

SIDE = 16


class Mesh(ctypes.Structure):
    _fields_ = [("size", c_size_t), ("positions", c_void_p), ("vertices", c_size_t), ("faces", c_void_p),
                ("face_count", c_size_t), ("vertex_colors", c_void_p), ("face_colors", c_void_p),
                ("transform", c_void_p), ("texcoords", c_void_p), ("texcoord_count", c_size_t),
                ("face_texcoords", c_void_p), ("textures", c_void_p), ("texture_count", c_size_t),
                ("face_textures", c_void_p)]


class LitMesh(ctypes.Structure):
    """With what was added to the struct later."""
    _fields_ = Mesh._fields_ + [("normals", c_void_p), ("normal_count", c_size_t), ("face_normals", c_void_p),
                                ("materials", c_void_p), ("material_count", c_size_t), ("face_materials", c_void_p)]


class Material(ctypes.Structure):
    _fields_ = [("specular", c_float * 3), ("shininess", c_float)]


class Texture(ctypes.Structure):
    _fields_ = [("width", c_int), ("height", c_int), ("texels", c_void_p), ("wrap", c_int), ("filter", c_int)]


class Camera(ctypes.Structure):
    _fields_ = [("size", c_size_t), ("view", c_float * 16), ("fov_y_degrees", c_float)]


class LossWeights(ctypes.Structure):
    _fields_ = [("size", c_size_t), ("mse", c_float), ("l1", c_float), ("silhouette", c_float)]


class Library:
    """The functions, whose failures are exceptions."""

    def __init__(self, file):
        self.library = ctypes.CDLL(file)
        self.library.dpr_last_error.restype = c_char_p
        self.library.dpr_version.restype = c_char_p

    def __getattr__(self, name):
        function = getattr(self.library, "dpr_" + name)

        def call(*arguments):
            if function(*arguments) != 0:
                raise RuntimeError(self.library.dpr_last_error().decode())

        return call


def refusal(call, *arguments):
    try:
        call(*arguments)
    except RuntimeError as error:
        return str(error)
    return ""


def check_textures(dpr, device, camera, positions, faces):
    """A texture is found again from its image: every texel that is seen."""
    texels, texcoords = (c_float * 6)(1, 0, 0, 0, 1, 0), (c_float * 6)(0, 0, 1, 0, 0.5, 1)
    texture = Texture(2, 1, ctypes.addressof(texels), 2, 1)  # DPR_WRAP_CLAMP, DPR_FILTER_BILINEAR
    mesh = Mesh(ctypes.sizeof(Mesh), ctypes.addressof(positions), 3, ctypes.addressof(faces), 1, None, None, None,
                ctypes.addressof(texcoords), 3, ctypes.addressof(faces), ctypes.addressof(texture), 1, None)
    scene, renderer, gradient = c_void_p(), c_void_p(), c_void_p()
    count = SIDE * SIDE * 4
    target, image, residual = (c_float * count)(), (c_float * count)(), (c_float * count)()
    dpr.scene_create(c_int(SIDE), c_int(SIDE), byref(scene))
    dpr.scene_add_mesh(scene, byref(mesh))
    dpr.scene_set_camera(scene, byref(camera))
    dpr.scene_set_gradients(scene, (c_char_p * 1)(b"texture"), c_size_t(1))
    dpr.renderer_create(device, byref(renderer))
    dpr.renderer_set_scene(renderer, scene)
    dpr.renderer_forward(renderer)
    dpr.renderer_read_image(renderer, target, c_size_t(count))
    found = (c_float * 6)(*[0.5] * 6)
    for _ in range(60):
        dpr.renderer_set_texels(renderer, c_size_t(0), c_size_t(0), found, c_size_t(6))
        dpr.renderer_forward(renderer)
        dpr.renderer_read_image(renderer, image, c_size_t(count))
        residual[:] = [i - t for i, t in zip(image, target)]
        grad = (c_double * 6)()
        dpr.backward_pixels(renderer, residual, c_size_t(count), byref(gradient))
        dpr.gradient_read(gradient, b"meshes[0].textures", grad, c_size_t(6))
        dpr.library.dpr_gradient_destroy(gradient)
        found[:] = [x - 0.03 * g for x, g in zip(found, grad)]
    assert max(abs(a - b) for a, b in zip(found, texels)) < 0.02, list(found)
    dpr.library.dpr_renderer_destroy(renderer)
    dpr.library.dpr_scene_destroy(scene)


def check_surface(dpr, device, camera, positions, faces):
    """A mesh that gives a normal and a material takes new ones; views take shapes; what a pixel shows is read."""
    normals, first = (c_float * 3)(0, 0, 1), (c_uint32 * 3)(0, 0, 0)
    material = Material((c_float * 3)(1, 1, 1), 0)
    mesh = LitMesh(size=ctypes.sizeof(LitMesh), positions=ctypes.addressof(positions), vertices=3,
                   faces=ctypes.addressof(faces), face_count=1, normals=ctypes.addressof(normals), normal_count=1,
                   face_normals=ctypes.addressof(first), materials=ctypes.addressof(material), material_count=1)
    scene, renderer, attribute, gradient = c_void_p(), c_void_p(), c_void_p(), c_void_p()
    dpr.scene_create(c_int(SIDE), c_int(SIDE), byref(scene))
    dpr.scene_add_mesh(scene, byref(mesh))
    dpr.scene_set_camera(scene, byref(camera))
    dpr.renderer_create(device, byref(renderer))
    dpr.renderer_set_scene(renderer, scene)
    dpr.renderer_set_normals(renderer, c_size_t(0), (c_float * 3)(0, 1, 1), c_size_t(3))
    dpr.renderer_set_materials(renderer, c_size_t(0), byref(Material((c_float * 3)(0, 0, 0), 5)), c_size_t(1))
    dpr.renderer_set_shapes(renderer, (c_float * 9)(*(x / 2 for x in positions)), c_size_t(9), None, c_size_t(0))
    dpr.renderer_set_background(renderer, (c_float * 3)(0, 0, 1))
    dpr.renderer_forward(renderer)
    depth = (c_float * (SIDE * SIDE))()
    dpr.renderer_read_aov(renderer, b"depth", depth, c_size_t(len(depth)))
    assert abs(max(depth) - 3) < 1e-3, max(depth)
    dpr.attribute_create(device, b"position", byref(attribute))
    dpr.attribute_forward(attribute, renderer)
    image = (c_float * (SIDE * SIDE * 4))()
    dpr.attribute_read_image(attribute, image, c_size_t(len(image)))
    dpr.attribute_backward_pixels(attribute, image, c_size_t(len(image)), byref(gradient))
    grad = (c_double * 9)()
    dpr.gradient_read(gradient, b"shapes.positions", grad, c_size_t(9))
    assert any(grad), list(grad)
    assert "expected 1" in refusal(dpr.renderer_set_normals, renderer, c_size_t(0), positions, c_size_t(9))
    for kind, handle in (("gradient", gradient), ("attribute", attribute), ("renderer", renderer), ("scene", scene)):
        getattr(dpr.library, f"dpr_{kind}_destroy")(handle)


def check_instances(dpr, device, camera, positions, faces):
    """A mesh in two places beside a mesh in one, as scenes of a batch: one loss, one backward pass, a gradient each."""
    mesh = Mesh(ctypes.sizeof(Mesh), ctypes.addressof(positions), 3, ctypes.addressof(faces), 1)
    aside = (c_float * 16)(0.5, 0, 0, 1, 0, 0.5, 0, 0, 0, 0, 0.5, 0.5, 0, 0, 0, 1)
    scenes, batch, loss, gradients = (c_void_p * 2)(), c_void_p(), c_void_p(), (c_void_p * 2)()
    for i in range(2):
        scene = c_void_p()
        dpr.scene_create(c_int(SIDE), c_int(SIDE), byref(scene))
        dpr.scene_add_mesh(scene, byref(mesh))
        dpr.scene_set_camera(scene, byref(camera))
        scenes[i] = scene.value
    dpr.scene_add_instance(c_void_p(scenes[1]), c_size_t(0), aside)
    dpr.batch_create(device, byref(batch))
    dpr.batch_set_scenes(batch, scenes, c_size_t(2))
    dpr.batch_forward(batch)
    count = 2 * SIDE * SIDE * 4
    image = (c_float * count)()
    dpr.batch_read_image(batch, image, c_size_t(count))
    assert sum(image[count // 2:]) > 1.05 * sum(image[:count // 2])
    dpr.loss_create(device, byref(LossWeights(ctypes.sizeof(LossWeights), 1, 0, 0)), (c_float * count)(),
                    c_size_t(count), c_size_t(2), c_int(SIDE), c_int(SIDE), byref(loss))
    dpr.loss_evaluate_batch(loss, batch, byref(c_double()))
    dpr.batch_backward_loss(batch, loss, gradients, c_size_t(2))
    grad = (c_double * 3)()
    dpr.gradient_read(c_void_p(gradients[1]), b"views[0].meshes[1].translation", grad, c_size_t(3))
    assert any(grad), list(grad)
    missing = refusal(dpr.gradient_read, c_void_p(gradients[1]), b"meshes[1].positions", grad, c_size_t(3))
    assert "one of meshes[0].positions" in missing, missing
    assert "one a scene" in refusal(dpr.batch_backward_loss, batch, loss, gradients, c_size_t(1))
    for kind, handle in (("gradient", gradients[0]), ("gradient", gradients[1]), ("loss", loss.value),
                         ("batch", batch.value), ("scene", scenes[0]), ("scene", scenes[1])):
        getattr(dpr.library, f"dpr_{kind}_destroy")(c_void_p(handle))


def main():
    dpr = Library(sys.argv[1])
    assert dpr.library.dpr_version().startswith(b"0.")
    positions = (c_float * 9)(-1, -1, 0, 1, -1, 0, 0, 1, 0)
    faces = (c_uint32 * 3)(0, 1, 2)
    mesh = Mesh(ctypes.sizeof(Mesh), ctypes.addressof(positions), 3, ctypes.addressof(faces), 1)
    # An older program's camera: what it does not have keeps its default.
    camera = Camera(ctypes.sizeof(Camera), (c_float * 16)(1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, -3, 0, 0, 0, 1), 60)

    device, scene, renderer, loss = c_void_p(), c_void_p(), c_void_p(), c_void_p()
    dpr.device_open(b"cpu", byref(device))
    dpr.scene_create(c_int(SIDE), c_int(SIDE), byref(scene))
    dpr.scene_add_mesh(scene, byref(mesh))
    dpr.scene_set_camera(scene, byref(camera))
    dpr.scene_set_smoothing_word(scene, b"preset", b"joint_gaussian")
    dpr.scene_set_smoothing_number(scene, b"sigma", c_double(0.01))
    dpr.renderer_create(device, byref(renderer))
    dpr.renderer_set_scene(renderer, scene)
    dpr.renderer_forward(renderer)
    target = (c_float * (SIDE * SIDE * 4))()
    dpr.renderer_read_image(renderer, target, c_size_t(len(target)))
    assert max(target) > 0.9, max(target)
    weights = LossWeights(ctypes.sizeof(LossWeights), 1, 0, 0)
    dpr.loss_create(device, byref(weights), target, c_size_t(len(target)), c_size_t(1), c_int(SIDE), c_int(SIDE),
                    byref(loss))

    moved = (c_float * 9)(*(x + 0.1 for x in positions))
    losses, gradient = [], c_void_p()
    for _ in range(40):
        dpr.renderer_set_positions(renderer, c_size_t(0), moved, c_size_t(9))
        dpr.renderer_forward(renderer)
        value, grad = c_double(), (c_double * 9)()
        dpr.loss_evaluate(loss, renderer, byref(value))
        dpr.backward_loss(renderer, loss, byref(gradient))
        dpr.gradient_read(gradient, b"meshes[0].positions", grad, c_size_t(9))
        dpr.library.dpr_gradient_destroy(gradient)
        moved = (c_float * 9)(*(x - g for x, g in zip(moved, grad)))
        losses.append(value.value)
    print("loss", losses[0], "to", losses[-1])
    assert losses[-1] < 0.1 * losses[0], losses

    check_textures(dpr, device, camera, positions, faces)
    check_surface(dpr, device, camera, positions, faces)
    check_instances(dpr, device, camera, positions, faces)
    assert "NULL" in refusal(dpr.scene_add_mesh, scene, None)
    assert "multiple of 3" in refusal(dpr.renderer_set_positions, renderer, c_size_t(0), moved, c_size_t(8))
    for kind, handle in (("loss", loss), ("renderer", renderer), ("scene", scene), ("device", device)):
        getattr(dpr.library, f"dpr_{kind}_destroy")(handle)


main()
