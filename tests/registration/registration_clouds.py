import numpy as np

from odom.geometry.se3 import apply, exp
from odom.registration import Pairs


def random_covariances(rng, n, sigma=0.01):
    roots = rng.normal(0.0, sigma, (n, 3, 3))
    return roots @ roots.transpose(0, 2, 1) + 0.01 * sigma**2 * np.eye(3)


def noisy_pairs(rng, n=100, angle=1.0, both=True):
    T = exp(rng.normal(0.0, angle, 6) * [0.5, 0.5, 0.5, 1, 1, 1])
    q = rng.uniform(-1.0, 1.0, (n, 3)) + np.array([0.0, 0.0, 2.0])
    C_source, C_target = random_covariances(rng, n), random_covariances(rng, n)

    def draw(C):
        return np.einsum("nij,nj->ni", np.linalg.cholesky(C), rng.normal(size=(n, 3)))

    p = apply(T, q) + draw(C_target)
    if both:
        return T, Pairs(q + draw(C_source), p, C_source, C_target)
    return T, Pairs(q, p, None, C_target)
