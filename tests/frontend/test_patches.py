import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from odom.frontend.features.patches import PATCH_LIMITS, UNWARPED, align_patches, cut_patches

SHAPE = (120, 160)
AT = np.array([[60.0, 50.0], [80.0, 62.0], [101.0, 70.0], [46.0, 75.0]])
IDENTITY = np.tile(UNWARPED, (len(AT), 1, 1))
ALL = np.arange(len(AT))
DITHER = 0.5
"""Grey levels of noise in the shifted pictures: without any, whole numbers err alike over a whole slope."""
ROUNDING = np.sqrt(2.0 * (DITHER**2 + 1.0 / 12.0))
"""Grey levels of noise in the patch and in the image together, that of whole numbers included."""
SIGMAS = 5.5
"""No error in a thousand runs of some 1,500 positions each; four sigma fell out once in ten runs."""
EVERY = np.ones(len(AT), dtype=bool)


def waves(seed, A=IDENTITY[0, :2], shift=(0.0, 0.0)):
    """A smooth picture: waves of 10 to 60 px in all directions, 40 grey levels rms about 0.

    At x it shows what is at A (x - centre - shift) + centre. A plane wave is a product of one along u and one along v.
    """
    rng = np.random.default_rng(seed)
    direction, length = rng.uniform(0, 2 * np.pi, 20), np.geomspace(10.0, 60.0, 20)
    k = 2 * np.pi / length[:, None] * np.column_stack([np.cos(direction), np.sin(direction)])
    centre = np.array([80.0, 60.0])
    phase = rng.uniform(0, 2 * np.pi, 20) + k @ (centre - A @ (centre + shift))
    along_u, along_v = (
        np.exp(1j * np.outer(np.arange(size), way)) for size, way in zip(SHAPE[::-1], (k @ A).T, strict=True)
    )
    return 40.0 * np.sqrt(0.1) * ((along_v * np.exp(1j * phase)) @ along_u.T).real


def picture(seed, A=IDENTITY[0, :2], shift=(0.0, 0.0), gain=0.8, offset=127.0, noise=0.0):
    grey = (
        gain * waves(seed, A, shift)
        + offset
        + noise * np.random.default_rng([seed + 1, round(1e6 * offset)]).normal(size=SHAPE)
    )
    return np.clip(np.rint(grey), 0, 255).astype(np.uint8)


@given(
    st.integers(0, 10_000),
    st.tuples(st.floats(-1.4, 1.4), st.floats(-1.4, 1.4)),
    st.floats(0.5, 0.8),
    st.floats(100.0, 155.0),
)
def test_a_shifted_patch_is_found_to_a_fiftieth_of_a_pixel_whatever_gain_and_offset(seed, shift, gain, offset):
    patches = cut_patches(picture(seed, noise=DITHER), AT)
    uv = AT.copy()
    score, covariance = align_patches(
        picture(seed, shift=shift, gain=gain, offset=offset, noise=DITHER),
        patches,
        ALL,
        IDENTITY,
        uv,
        EVERY,
        12,
        4.0,
        PATCH_LIMITS,
    )
    assert (score > 0.98).all()
    rounding = ROUNDING * np.sqrt(covariance[:, [0, 2]])
    assert (np.abs(uv - AT - np.array(shift)) < 0.02 + SIGMAS * rounding).all()


@settings(max_examples=30)
@given(st.integers(0, 1000), st.floats(0.75, 1.3), st.floats(-0.4, 0.4), st.floats(-0.2, 0.2))
def test_a_turned_and_scaled_patch_is_found_through_its_affinity(seed, scale, turn, shear):
    A = scale * np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]) @ [[1, shear], [0, 1]]
    centre = np.array([80.0, 60.0])
    truth = (AT - centre) @ np.linalg.inv(A).T + centre
    patches = cut_patches(picture(seed), AT)
    image = picture(seed, A)
    uv = truth + 0.7
    H = np.tile([*A, [0.0, 0.0]], (len(AT), 1, 1))
    score, covariance = align_patches(image, patches, ALL, H, uv, EVERY, 12, 4.0, PATCH_LIMITS)
    assert (score > 0.97).all()
    rounding = ROUNDING * np.sqrt(covariance[:, [0, 2]])
    assert (np.abs(uv - truth) < 0.05 + 4.0 * rounding).all()


def test_the_claimed_covariance_is_that_of_repeated_measurements():
    reference, errors, claimed = cut_patches(picture(4), AT), [], []
    clean = 0.8 * waves(4) + 127.0
    for k in range(300):
        grey = clean + 4.0 * np.random.default_rng(k).normal(size=SHAPE)
        uv = AT.copy()
        _, covariance = align_patches(
            np.rint(grey).astype(np.uint8), reference, ALL, IDENTITY, uv, EVERY, 12, 4.0, PATCH_LIMITS
        )
        errors.append(uv - AT)
        claimed.append(covariance * 4.0**2)
    for k in range(len(AT)):
        seen = np.cov(np.array(errors)[:, k].T)
        uu, uv_, vv = np.mean(claimed, axis=0)[k]
        np.testing.assert_allclose(seen, [[uu, uv_], [uv_, vv]], atol=0.35 * max(uu, vv))


def test_a_patch_that_is_not_there_gets_a_low_score():
    score, _ = align_patches(
        picture(7), cut_patches(picture(5), AT), ALL, IDENTITY, AT.copy(), EVERY, 12, 4.0, PATCH_LIMITS
    )
    assert (score < 0.75).all()


def test_flat_or_one_dimensional_patches_the_border_and_huge_warps_are_not_aligned():
    u = np.arange(SHAPE[1])
    stripes = np.tile((127 + 60 * np.sin(u / 3.0)).astype(np.uint8), (SHAPE[0], 1))
    flat = np.full(SHAPE, 90, np.uint8)
    for image in (stripes, flat):
        score, _ = align_patches(image, cut_patches(image, AT), ALL, IDENTITY, AT.copy(), EVERY, 8, 4.0, PATCH_LIMITS)
        assert (score == 0).all()
    image = picture(1)
    corners = np.array([[2.0, 2.0], [158.0, 50.0], [50.0, 118.0], [1e6, -1e6]])
    assert (
        align_patches(image, cut_patches(image, AT), ALL, IDENTITY, corners, EVERY, 8, 4.0, PATCH_LIMITS)[0] == 0
    ).all()
    assert (
        align_patches(image, cut_patches(image, AT), ALL, 4.0 * IDENTITY, AT.copy(), EVERY, 8, 4.0, PATCH_LIMITS)[0]
        == 0
    ).all()
    nothing = np.zeros(len(AT), dtype=bool)
    assert (
        align_patches(image, cut_patches(image, AT), ALL, IDENTITY, AT.copy(), nothing, 8, 4.0, PATCH_LIMITS)[0] == 0
    ).all()


def test_an_alignment_never_leaves_its_limit():
    patches, start = cut_patches(picture(9), AT), AT + np.array([3.0, -3.0])
    uv = start.copy()
    align_patches(picture(9), patches, ALL, IDENTITY, uv, EVERY, 20, 1.0, PATCH_LIMITS)
    assert np.abs(uv - start).max() <= 1.0
