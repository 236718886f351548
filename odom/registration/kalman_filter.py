"""KF: the paper's Algorithm 1, corrected, on the joint state [R | t]: the covariances are taken at their word."""

from odom.registration.pairs import Pairs, Prior, Registration, degenerate
from odom.registration.solve import Judgement, checked, judged, observed_factor, solve, start


def kalman(pairs: Pairs, prior: Prior | None = None) -> Registration:
    """Return the motion of `pairs` by the Kalman filter (eqs. 11-16) in information form.

    Corrected against the paper: H is built from q, R holds variances (`S_k = Sp + R Sq R'`), the joint state needs no
    centroids, there is no false prior on the identity, and the projection onto SE(3) is weighted by the information.
    Errors and verdicts as for `register`.
    """
    arrays = checked(pairs)
    n = len(arrays.q)
    if n < 3:
        return degenerate(n, f"{n} pairs: at least 3 are needed")
    first = prior.T_target_source if prior is not None else start(arrays, arrays.weights)
    solution = solve(arrays, prior, first, arrays.weights)
    return judged(arrays, prior, solution, Judgement(variance_factor=observed_factor(solution)))
