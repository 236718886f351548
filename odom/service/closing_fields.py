"""What a closed walk says in `report.json`: the closing tests of the trajectory and of the chain."""

import numpy as np
from numpy.typing import NDArray

from odom.backend import ClosedChain, ClosingTest
from odom.geometry.se3 import so3_log


def closing_fields(test: ClosingTest | None, closed: ClosedChain | None) -> dict[str, object]:
    """Return the entries of the report that say how the walk closes: `closing` and `chain_closed`."""
    return {"closing": _of_the_walk(test), "chain_closed": _of_the_chain(closed)}


def _of_the_walk(test: ClosingTest | None) -> dict[str, object] | None:
    """Return the paper's test of a closed walk for the report: the last frame against the first and its predecessor.

    Translations in metres and rotation vectors in degrees of the last frame in the other's camera; None where the
    last frame does not show what the first one did.
    """
    if test is None:
        return None
    sigma = np.sqrt(np.diag(test.direct.covariance))
    return {
        "first_last": _motion(test.direct.T_earlier_current),
        "first_last_sigma": {"m": sigma[:3].tolist(), "deg": np.degrees(sigma[3:]).tolist()},
        "first_last_inliers": test.direct.inliers,
        "first_last_trajectory": _motion(test.T_first_last_trajectory),
        "previous_last": None if test.pairwise is None else _motion(test.pairwise.T_earlier_current),
        "disagreement_m": test.disagreement_m,
        "disagreement_deg": test.disagreement_deg,
        "disagreement_sigma": test.disagreement_sigma,
    }


def _of_the_chain(closed: ClosedChain | None) -> dict[str, object] | None:
    """Return the closed chain's entries of the report, with the closing test of the chain (see `ChainClosing`).

    None where the chain has not begun.
    """
    if closed is None:
        return None
    counts = {"closures": closed.closures, "refused": closed.refused, "pieces": closed.pieces}
    fields: dict[str, object] = {**counts, "closing": None}
    if (test := closed.closing) is not None:
        fields["closing"] = {
            "first_last": _motion(test.direct.T_earlier_current),
            "first_last_chain": _motion(test.T_first_last_chain),
            "first_last_closed": _motion(test.T_first_last_closed),
            "previous_last": None if test.pairwise is None else _motion(test.pairwise.T_earlier_current),
            "chain_sigma": test.chain_sigma,
            "closed_sigma": test.closed_sigma,
        }
    return fields


def _motion(T: NDArray[np.float64]) -> dict[str, list[float]]:
    return {"m": T[:3, 3].tolist(), "deg": np.degrees(so3_log(T[:3, :3])).tolist()}
