"""Standard deviations of a least-squares solution that stay valid when the model of the errors is not exact."""

import numpy as np

from odom.geometry.arrays import Array


def sandwich_sigma(information: Array, scores: Array, blocks: int) -> Array:
    """Return k standard deviations from the k x k information and the n x k scores (weighted J' r of each residual).

    The larger of the plain estimate and of the block sandwich (W. Newey and K. West, 1987), which allows for errors
    that are correlated within one of the `blocks` of successive residuals.
    """
    bread = np.linalg.inv(information)
    sums = np.array([part.sum(axis=0) for part in np.array_split(scores, blocks)])
    meat = sums.T @ sums * len(sums) / (len(sums) - 1)
    return np.asarray(np.sqrt(np.maximum(np.maximum(np.diag(bread), np.diag(bread @ meat @ bread)), 0.0)))
