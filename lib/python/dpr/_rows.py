"""Gathers and scatters of table rows, with faster gradients on the CPU than PyTorch's own."""
import torch
from torch.autograd.function import once_differentiable


def _flat(index, channels):
    return (index[:, None] * channels + torch.arange(channels)).reshape(-1)


def _summed(rows, index, count):
    """Sums rows [K, C] into a table [count, C] at their indices [K]."""
    table = rows.new_zeros(count * rows.shape[1])
    return table.scatter_add_(0, _flat(index, rows.shape[1]), rows.reshape(-1)).reshape(count, -1)


def between(a, b, part):
    """a + part (b - a): faster than torch.lerp()."""
    return a + part * (b - a)


class _Rows(torch.autograd.Function):
    @staticmethod
    def forward(ctx, table, index):
        ctx.save_for_backward(index)
        ctx.count = len(table)
        return table.index_select(0, index)

    @staticmethod
    @once_differentiable
    def backward(ctx, grad):
        return _summed(grad, *ctx.saved_tensors, ctx.count), None


class _Spread(torch.autograd.Function):
    @staticmethod
    def forward(ctx, rows, index, count):
        ctx.save_for_backward(index)
        return _summed(rows, index, count)

    @staticmethod
    @once_differentiable
    def backward(ctx, grad):
        return grad.index_select(0, *ctx.saved_tensors), None, None


class _Bilinear(torch.autograd.Function):
    @staticmethod
    def forward(ctx, table, index, x, y):
        ctx.save_for_backward(table, index, x, y)
        a, b, c, d = (table.index_select(0, corner) for corner in index)
        return between(between(a, b, x), between(c, d, x), y)

    @staticmethod
    @once_differentiable
    def backward(ctx, grad):
        table, index, x, y = ctx.saved_tensors
        grad_table = grad_x = grad_y = None
        if ctx.needs_input_grad[0]:
            low, high = grad * (1 - y), grad * y
            rows = torch.cat([low * (1 - x), low * x, high * (1 - x), high * x])
            grad_table = _summed(rows, index.reshape(-1), len(table))
        if ctx.needs_input_grad[2] or ctx.needs_input_grad[3]:
            a, b, c, d = (table.index_select(0, corner) for corner in index)
            grad_x = (grad * between(b - a, d - c, y)).sum(1, keepdim=True)
            grad_y = (grad * between(c - a, d - b, x)).sum(1, keepdim=True)
        return grad_table, None, grad_x, grad_y


def rows(table, index):
    """Rows [K, C] of a table [R, C] at indices [K]."""
    return _Rows.apply(table, index)


def spread(values, index, count):
    """Table [count, C] with rows [K, C] at different indices [K], and 0 elsewhere."""
    return _Spread.apply(values, index, count)


def bilinear(table, index, x, y):
    """Bilinear mix [K, C] of four rows with indices [4, K]: x [K, 1] leads from the first to the second and from the
    third to the fourth row, y from the first to the second pair."""
    return _Bilinear.apply(table, index, x, y)
