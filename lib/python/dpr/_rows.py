"""Gathers of table rows, with faster gradients on the CPU than PyTorch's own."""
import torch
from torch.autograd.function import once_differentiable


class _Rows(torch.autograd.Function):
    @staticmethod
    def forward(ctx, table, index):
        ctx.save_for_backward(index)
        ctx.count = len(table)
        return table.index_select(0, index)

    @staticmethod
    @once_differentiable
    def backward(ctx, grad):
        index, = ctx.saved_tensors
        channels = grad.shape[1]
        places = (index[:, None] * channels + torch.arange(channels)).reshape(-1)
        table = grad.new_zeros(ctx.count * channels).scatter_add_(0, places, grad.reshape(-1))
        return table.reshape(ctx.count, channels), None


def rows(table, index):
    """Rows [K, C] of a table [R, C] at indices [K]."""
    return _Rows.apply(table, index)
