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


def rows(table, index):
    """Rows [K, C] of a table [R, C] at indices [K]."""
    return _Rows.apply(table, index)


def spread(values, index, count):
    """Table [count, C] with rows [K, C] at different indices [K], and 0 elsewhere."""
    return _Spread.apply(values, index, count)
