"""Landmarks eliminated from normal equations (Schur complement), one after the other, in compiled loops.

With poses' and other unknowns x and landmarks' y, the normal equations are [U W; W' V] [x; y] = [a; b], V block
diagonal; S = U - W inv(V) W', rhs = a - W inv(V) b. Source: B. Triggs et al., "Bundle adjustment - a modern synthesis",
2000, section 6.1.
"""

from odom.geometry.arrays import Array, Index
from odom.geometry.compiled import compiled

BEHIND_CAMERA_COST = 100.0
"""Cost of a landmark behind the camera, more than the robust cost of any residual: such steps are refused."""


@compiled
def longest_run(landmark: Index) -> int:
    """Return how many observations a landmark has at the most; `landmark` (N) is sorted."""
    longest, begun = 0, 0
    for o in range(len(landmark)):
        if landmark[o] != landmark[begun]:
            begun = o
        longest = max(longest, o + 1 - begun)
    return longest


@compiled
def invert_damped(V: Array, damping: float, inverse: Array) -> None:
    """Damp a landmark's V (3 x 3, symmetric) and fill its `inverse`, by cofactors."""
    for a in range(3):
        V[a, a] += damping * V[a, a] + 1e-9
    c00 = V[1, 1] * V[2, 2] - V[1, 2] * V[2, 1]
    c01 = V[0, 2] * V[2, 1] - V[0, 1] * V[2, 2]
    c02 = V[0, 1] * V[1, 2] - V[0, 2] * V[1, 1]
    determinant = V[0, 0] * c00 + V[1, 0] * c01 + V[2, 0] * c02
    inverse[0, 0], inverse[0, 1], inverse[0, 2] = c00 / determinant, c01 / determinant, c02 / determinant
    inverse[1, 1] = (V[0, 0] * V[2, 2] - V[0, 2] * V[0, 2]) / determinant
    inverse[1, 2] = (V[0, 2] * V[0, 1] - V[0, 0] * V[1, 2]) / determinant
    inverse[2, 2] = (V[0, 0] * V[1, 1] - V[0, 1] * V[0, 1]) / determinant
    inverse[1, 0], inverse[2, 0], inverse[2, 1] = inverse[0, 1], inverse[0, 2], inverse[1, 2]


@compiled
def mirror_upper(S: Array) -> None:
    """Add to each entry its mirror image, where each was summed up on one side of the diagonal alone."""
    for a in range(len(S)):
        for b in range(a):
            S[a, b] = S[b, a] = S[a, b] + S[b, a]
