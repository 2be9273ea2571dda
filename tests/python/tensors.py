"""What the tests with PyTorch share."""
import unittest

import numpy as np
import torch


def random(*shape, seed=1):
    return torch.rand(*shape, generator=torch.Generator().manual_seed(seed))


def differences(function, values, step):
    """Central differences of a number by every one of a tensor's."""
    found = torch.zeros_like(values)
    for i in range(values.numel()):
        ahead, behind = values.clone(), values.clone()
        ahead.view(-1)[i] += step
        behind.view(-1)[i] -= step
        found.view(-1)[i] = (function(ahead) - function(behind)) / (ahead.view(-1)[i] - behind.view(-1)[i])
    return found


class TestCase(unittest.TestCase):
    def check_close(self, found, expected, tolerance):
        found, expected = (np.asarray(array.detach() if isinstance(array, torch.Tensor) else array)
                           for array in (found, expected))
        self.assertEqual(found.shape, expected.shape)
        self.assertGreater(np.abs(expected).max(), 0)
        self.assertLess(np.abs(found - expected).max() / np.abs(expected).max(), tolerance)
