"""The operator from Python: loaded, differentiated by torch.autograd.gradcheck, trained through. Argument: the library."""
import sys

try:
    import torch
except ImportError:
    print("skipped: no python3-torch")
    sys.exit(0)

torch.ops.load_library(sys.argv[1])
torch.manual_seed(1)

SIZE = 16
FACES = torch.tensor([[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]])
# No side is seen edge-on, and no pixel lies as near to one edge as to another: the image has kinks there.
TETRAHEDRON = torch.tensor([[0.1, 0.9, 0.2], [-0.8, -0.3, 0.5], [0.9, -0.5, 0.4], [0.05, 0.25, -0.9]])
TETRAHEDRON += 0.05 * (torch.rand(4, 3, generator=torch.Generator().manual_seed(10)) - 0.5)
BACKGROUND = torch.tensor([0.1, 0.2, 0.3])


def cameras(count):
    """Looking at the origin from +z, each a little further away."""
    views = torch.eye(4).repeat(count, 1, 1)
    views[:, 2, 3] = -4.0 - 0.3 * torch.arange(count)
    return views, torch.tensor([20.0, 20.0, 8.1, 7.9]).repeat(count, 1)


def make_renderer():
    renderer = torch.classes.dpr.Renderer(FACES, SIZE, SIZE, "joint_gaussian", "")
    renderer.set("sigma", 5e-3)
    renderer.set("gamma", 5e-2)
    renderer.set("occupancy_threshold", 1e-6)
    renderer.set("zfar", 10)
    return renderer


def check_gradients():
    """In double precision outside, single inside: the step is as large as that needs."""
    renderer = make_renderer()
    views, intrinsics = cameras(2)

    def images(*tensors):
        return torch.ops.dpr.render(renderer, *[t.float() for t in tensors]).double()

    arguments = [TETRAHEDRON.repeat(2, 1, 1), torch.rand(2, 4, 3), views, intrinsics, BACKGROUND]
    # The matrices' last rows are fixed: what is passed on is made of the others.
    def of_rows(vertices, colors, rows, k, background):
        last = torch.tensor([0.0, 0.0, 0.0, 1.0], dtype=rows.dtype).expand(2, 1, 4)
        return images(vertices, colors, torch.cat((rows, last), 1), k, background)

    arguments[2] = views[:, :3]
    weights = torch.rand(2, SIZE, SIZE, 4).double() - 0.5

    def loss(*tensors):
        return (of_rows(*tensors) * weights).sum()

    doubles = [a.double().requires_grad_() for a in arguments]
    assert torch.autograd.gradcheck(loss, doubles, eps=1e-3, atol=5e-3, rtol=1e-3)


def check_training():
    renderer = make_renderer()
    views, intrinsics = cameras(2)
    colors = torch.rand(1, 4, 3)
    with torch.no_grad():
        target = torch.ops.dpr.render(renderer, TETRAHEDRON[None], colors, views, intrinsics, BACKGROUND)
    vertices = (0.7 * TETRAHEDRON[None] + 0.1).requires_grad_()
    learned = torch.full((1, 4, 3), 0.5, requires_grad=True)
    optimizer = torch.optim.Adam([vertices, learned], lr=0.03)
    losses = []
    for _ in range(80):
        optimizer.zero_grad()
        image = torch.ops.dpr.render(renderer, vertices, learned, views, intrinsics, BACKGROUND)
        loss = (image - target).square().mean()
        loss.backward()
        optimizer.step()
        losses.append(loss.item())
    assert losses[-1] < 0.1 * losses[0], losses


def check_errors():
    views, intrinsics = cameras(1)
    try:
        torch.ops.dpr.render(make_renderer(), TETRAHEDRON, torch.rand(1, 4, 3), views, intrinsics, BACKGROUND)
    except RuntimeError as error:
        assert "vertices (dpr::render): got [4, 3], expected [view or 1, vertex, 3]" in str(error), error
    else:
        raise AssertionError("no error")


check_gradients()
check_training()
check_errors()
print("passed")
