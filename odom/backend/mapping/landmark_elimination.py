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
def eliminate_from_pose(S: Array, rhs: Array, f: int, W: Array, inverse: Array, b: Array, carried: Array) -> None:
    """Subtract W inv(V) W' from the upper half of a pose's block on the diagonal of S, at `f`, and W inv(V) b from rhs.

    `W` is W' (3 x 6); fills `carried` (3 x 6) with inv(V) W'.
    """
    for i in range(6):
        w0, w1, w2 = W[0, i], W[1, i], W[2, i]
        y0 = w0 * inverse[0, 0] + w1 * inverse[1, 0] + w2 * inverse[2, 0]
        y1 = w0 * inverse[0, 1] + w1 * inverse[1, 1] + w2 * inverse[2, 1]
        y2 = w0 * inverse[0, 2] + w1 * inverse[1, 2] + w2 * inverse[2, 2]
        carried[0, i], carried[1, i], carried[2, i] = y0, y1, y2
        rhs[f + i] -= y0 * b[0] + y1 * b[1] + y2 * b[2]
        for j in range(i, 6):
            S[f + i, f + j] -= y0 * W[0, j] + y1 * W[1, j] + y2 * W[2, j]


@compiled
def eliminate_between(S: Array, f: int, g: int, carried: Array, W: Array) -> None:
    """Subtract W inv(V) W' from the block of S of two poses, at `f` and `g`; `carried` is inv(V) W' of the first.

    All is read before it is written, so that the compiler computes several entries at a time.
    """
    p0, p1, p2, p3, p4, p5 = W[0, 0], W[0, 1], W[0, 2], W[0, 3], W[0, 4], W[0, 5]
    q0, q1, q2, q3, q4, q5 = W[1, 0], W[1, 1], W[1, 2], W[1, 3], W[1, 4], W[1, 5]
    r0, r1, r2, r3, r4, r5 = W[2, 0], W[2, 1], W[2, 2], W[2, 3], W[2, 4], W[2, 5]
    for i in range(6):
        y0, y1, y2 = carried[0, i], carried[1, i], carried[2, i]
        row = S[f + i, g : g + 6]
        row[0], row[1], row[2], row[3], row[4], row[5] = (
            row[0] - (y0 * p0 + y1 * q0 + y2 * r0),
            row[1] - (y0 * p1 + y1 * q1 + y2 * r1),
            row[2] - (y0 * p2 + y1 * q2 + y2 * r2),
            row[3] - (y0 * p3 + y1 * q3 + y2 * r3),
            row[4] - (y0 * p4 + y1 * q4 + y2 * r4),
            row[5] - (y0 * p5 + y1 * q5 + y2 * r5),
        )


@compiled
def substitute(
    landmarks: Array,
    place: Index,
    landmark: Index,
    V_inverse: Array,
    b: Array,
    W_other: Array,
    W: Array,
    step: Array,
    step_other: Array,
) -> Array:
    """Return the landmarks (L x 3) moved by inv(V) (b - W' step), what steps of poses and others leave of b.

    `place` (N) is where the six unknowns begin of each observation's pose; `W_other` (L x 3 x m), `W` (N x 3 x 6): W'.
    """
    moved, rest = landmarks.copy(), b.copy()
    for o in range(len(landmark)):
        f = place[o]
        if f >= 0:
            for j in range(3):
                for i in range(6):
                    rest[landmark[o], j] -= W[o, j, i] * step[f + i]
    for k in range(len(landmarks)):
        for j in range(3):
            for i in range(len(step_other)):
                rest[k, j] -= W_other[k, j, i] * step_other[i]
        for i in range(3):
            for j in range(3):
                moved[k, i] += V_inverse[k, i, j] * rest[k, j]
    return moved


@compiled
def mirror_upper(S: Array) -> None:
    """Add to each entry its mirror image, where each was summed up on one side of the diagonal alone."""
    for a in range(len(S)):
        for b in range(a):
            S[a, b] = S[b, a] = S[a, b] + S[b, a]
