"""What is held out to judge a calibration can be placed by the rest."""

from dataclasses import replace

import numpy as np

from odom.calibration.adjustment import start_of
from odom.calibration.held_out import residuals, split
from odom.calibration.parameters import LENS, vector_of
from tests.calibration.made_up_walk import made_up_survey, spoilt


def glimpsed():
    """The survey of a camera that saw a fifth of the landmarks without depth, in three frames running each."""
    survey = made_up_survey(spoilt())
    brief = survey.landmark % 5 == 0
    first = np.full(len(survey.landmarks), 99)
    np.minimum.at(first, survey.landmark, survey.frame)
    kept = ~brief | (survey.frame < first[survey.landmark] + 3)
    return replace(survey, inverse_depth=np.where(brief, np.nan, survey.inverse_depth)).part(kept)


def test_what_is_held_out_is_of_landmarks_whose_depth_the_rest_measured():
    survey = glimpsed()
    held = split(survey)
    seen = survey.part(~held)
    deep = np.unique(seen.landmark[np.isfinite(seen.inverse_depth)])
    assert 0.05 < held.mean() < 0.25
    assert np.isin(survey.landmark[held], deep).all()


def test_a_landmark_behind_the_camera_does_not_decide_between_two_lenses():
    """Where it has no image, a lens with distortion can put it at a distance that outweighs all that was seen."""
    survey = made_up_survey(spoilt())
    start, straight = start_of(survey), vector_of(survey.camera)
    bent = straight.copy()
    bent[LENS][-5:] = 0.2, -0.5, 0.0, 0.0, 0.4
    behind = start.landmarks.copy()
    at = int(np.flatnonzero(np.bincount(survey.landmark) > 0)[0])
    T = start.T_camera_map[survey.frame[survey.landmark == at][0]]
    behind[at] = np.linalg.solve(T[:3, :3], np.array([30.0, 40.0, -100.0]) - T[:3, 3])
    spoils = [
        residuals(survey, vector, replace(start, landmarks=behind)).ray_cost - residuals(survey, vector, start).ray_cost
        for vector in (straight, bent)
    ]
    assert np.isfinite(spoils).all()
    assert abs(spoils[1] - spoils[0]) < 0.01 * residuals(survey, straight, start).ray_cost
