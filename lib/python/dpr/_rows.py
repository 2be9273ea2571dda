"""Gathers and scatters of table rows, with faster gradients on the CPU than PyTorch's own."""
import torch
from torch.autograd.function import once_differentiable


def _flat(index, channels):
    return (index[:, None] * channels + torch.arange(channels)).reshape(-1)


def _summed(parts, count, channels):
    """Table [count, C] with the rows of each part, (rows [K, C], indices [K]), added at their indices."""
    table = torch.zeros(count * channels, dtype=torch.float32)
    for rows_of, index in parts:
        table.scatter_add_(0, _flat(index, channels), rows_of.reshape(-1))
    return table.reshape(count, channels)


class _Rows(torch.autograd.Function):
    @staticmethod
    def forward(ctx, table, index):
        ctx.save_for_backward(index)
        ctx.count = len(table)
        return table.index_select(0, index)

    @staticmethod
    @once_differentiable
    def backward(ctx, grad):
        return _summed([(grad, *ctx.saved_tensors)], ctx.count, grad.shape[1]), None


class _Spread(torch.autograd.Function):
    @staticmethod
    def forward(ctx, rows, index, count):
        ctx.save_for_backward(index)
        return _summed([(rows, index)], count, rows.shape[1])

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
            parts = ((grad * weight[:, None], of_row) for of_row, weight in zip(index, weights))
            grad_table = _summed(parts, len(table), table.shape[1])
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
