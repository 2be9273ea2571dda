"""Gathers and scatters of table rows, with faster gradients on the CPU than PyTorch's own."""
import torch
from torch.autograd.function import once_differentiable


def _flat(index, channels):
    return (index[:, None] * channels + torch.arange(channels)).reshape(-1)


def _summed(rows, index, count):
    """Sums rows [K, C] into a table [count, C] at their indices [K]."""
    table = rows.new_zeros(count * rows.shape[1])
    return table.scatter_add_(0, _flat(index, rows.shape[1]), rows.reshape(-1)).reshape(count, -1)


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


class _Mixed(torch.autograd.Function):
    @staticmethod
    def forward(ctx, table, index, weights):
        ctx.save_for_backward(table, index, weights)
        return sum(table.index_select(0, of_row) * weight[:, None] for of_row, weight in zip(index, weights))

    @staticmethod
    @once_differentiable
    def backward(ctx, grad):
        table, index, weights = ctx.saved_tensors
        grad_table = grad_weights = None
        if ctx.needs_input_grad[0]:
            parts = torch.cat([grad * weight[:, None] for weight in weights])
            grad_table = _summed(parts, index.reshape(-1), len(table))
        if ctx.needs_input_grad[2]:
            ones = grad.new_ones(grad.shape[1])  # a product of matrices is the fastest sum of short rows
            grad_weights = torch.stack([(table.index_select(0, of_row) * grad) @ ones for of_row in index])
        return grad_table, None, grad_weights


def rows(table, index):
    """Rows [K, C] of a table [R, C] at indices [K]."""
    return _Rows.apply(table, index)


def spread(values, index, count):
    """Table [count, C] with rows [K, C] at different indices [K], and 0 elsewhere."""
    return _Spread.apply(values, index, count)


def mixed(table, index, weights):
    """Sums [K, C] of R rows each, with indices [R, K] and weights [R, K]."""
    return _Mixed.apply(table, index, weights)
