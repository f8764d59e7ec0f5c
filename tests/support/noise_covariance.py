"""The covariance of noise, reading by reading: what whitening is the inverse root of."""

from __future__ import annotations

import numpy as np

from crosscheck.inference.noise import Chain, Noise
from seecr.pose import Array


def covariance(c: Chain, noise: Noise, weight: Array) -> Array:
    """(N, N) in units of the stated noise."""
    n = len(c.row)
    root = np.zeros((n, n))
    for k in range(n):
        root[k, k] = 1.0
        if c.before[k] >= 0:
            phi = noise.rho[c.kind[k]] ** c.gap[k]
            root[k] = phi * root[c.before[k]]
            root[k, k] = np.sqrt(1 - phi**2)
    root = root * (noise.scale[c.kind] / np.sqrt(weight))[:, None]
    return np.asarray(root @ root.T)
