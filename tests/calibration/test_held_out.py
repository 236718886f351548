"""What is held out to judge a calibration can be placed by the rest."""

from dataclasses import replace

import numpy as np

from odom.calibration.held_out import split
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
