"""Oracle: the robust H-infinity filter in the paper's own form, nine states, one pair a step, uncertain measurement.

Eqs. (22)-(28) with the recursion of Y. Hung and F. Yang, "Robust H-infinity filtering with error variance constraints
for discrete time-varying systems with uncertainty", Automatica 39, 2003. With A = I and no process noise it becomes
the information form that the project uses for the joint state [R | t].
"""

from dataclasses import dataclass

import numpy as np

from odom.errors import InputError
from odom.geometry.arrays import Array


@dataclass(frozen=True, eq=False)
class UncertainSystem:
    """`x+ = (A + dA) x + D1 w`, `y = (C + dC) x + D2 w`, `z = L x`, `[dA; dC] = [M1; M2] Gamma N`: eqs. (22)-(27).

    Shapes: A n x n, C m x n, D1 n x q, D2 m x q, M1 n x p, M2 m x p, N r x n, L l x n.
    """

    A: Array
    C: Array
    D1: Array
    D2: Array
    M1: Array
    M2: Array
    N: Array
    L: Array


@dataclass(frozen=True, eq=False)
class FilterState:
    """Estimate x (n), bound Q1 (n x n) of its error covariance, bound Q2 (n x n) of the second moment of the state."""

    x: Array
    Q1: Array
    Q2: Array


def hinfinity_step(
    state: FilterState, model: UncertainSystem, y: Array, alpha: float, theta: float, epsilon: float = 0.0
) -> FilterState:
    """Return the state after measurement `y` (m), with `alpha` > 0 for the uncertainty and `theta` = 1 / gamma >= 0.

    Raises InputError when `alpha I > N Q2 N'` or `theta^-2 I > L Q1 L'` fails: the filter does not exist for them.
    """
    A, C, L, N = model.A, model.C, model.L, model.N
    eye = np.eye(len(state.x))
    if np.linalg.eigvalsh(N @ state.Q2 @ N.T)[-1] >= alpha:
        raise InputError(f"alpha = {alpha} does not exceed N Q2 N': take a larger alpha, or reset Q2")
    if theta > 0.0 and np.linalg.eigvalsh(L @ state.Q1 @ L.T)[-1] >= theta**-2:
        raise InputError(f"theta = {theta} is infeasible against L Q1 L': take a smaller theta")
    R11 = model.D1 @ model.D1.T + alpha * model.M1 @ model.M1.T
    R12 = model.D1 @ model.D2.T + alpha * model.M1 @ model.M2.T
    R22 = model.D2 @ model.D2.T + alpha * model.M2 @ model.M2.T
    S = np.linalg.inv(np.linalg.inv(state.Q2) - N.T @ N / alpha)
    T = np.linalg.inv(np.linalg.inv(state.Q1) - theta**2 * L.T @ L)
    inverse_R1 = np.linalg.inv(S @ A.T)
    R2 = np.linalg.inv(A @ S @ A.T)
    A1 = A + R11 @ inverse_R1
    C1 = C + R12.T @ inverse_R1
    R = C1 @ T @ C1.T + R12.T @ R2 @ R12 + R22
    G = (A1 @ T @ C1.T + R11 @ R2 @ R12 + R12) @ np.linalg.inv(R)
    x = (A1 - G @ C1) @ state.x + G @ y  # eq. (28)
    Q1 = A1 @ T @ A1.T + R11 + R11 @ R2 @ R11.T - G @ R @ G.T + epsilon * eye
    Q2 = A @ S @ A.T + R11 + epsilon * eye
    return FilterState(x, Q1, Q2)


def rotation_model(q: Array, Sq: Array, Sp: Array, rho: float = 1.0) -> UncertainSystem:
    """Return the model of one pair for the nine states vec(R) (row by row): `p = (I3 (x) q') x + e`, eq. (10).

    `Sq`, `Sp` (3 x 3) are the covariances of source and target; source noise of up to `rho` sigma makes the
    measurement matrix uncertain (eq. 25, of the sigmas only): `dC = rho I3 Gamma (I3 (x) sqrt(Sq))`. No process
    noise: one rigid motion.
    """
    w, V = np.linalg.eigh(Sq)
    root = V * np.sqrt(np.maximum(w, 0.0)) @ V.T
    return UncertainSystem(
        A=np.eye(9),
        C=np.asarray(np.kron(np.eye(3), q), dtype=np.float64),
        D1=np.zeros((9, 3)),
        D2=np.asarray(np.linalg.cholesky(Sp), dtype=np.float64),
        M1=np.zeros((9, 3)),
        M2=rho * np.eye(3),
        N=np.kron(np.eye(3), root),
        L=np.eye(9),
    )


def kalman_step(x: Array, P: Array, q: Array, p: Array, R: Array) -> tuple[Array, Array]:
    """Return nine states and their covariance (9 x 9) after one pair: Algorithm 1, H built from the SOURCE point q.

    `R` (3 x 3) holds variances, where the paper prints standard deviations; there is no process noise in one motion.
    """
    H = np.kron(np.eye(3), q)  # eq. (10)
    y = H @ x  # eq. (12)
    K = P @ H.T @ np.linalg.inv(H @ P @ H.T + R)  # eq. (14)
    return x + K @ (p - y), (np.eye(9) - K @ H) @ P  # eqs. (15), (16)
