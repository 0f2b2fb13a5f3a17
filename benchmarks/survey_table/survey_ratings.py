"""The ratings of the survey's Table 1, for the measured columns (Todor 2009, section 7.5)."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class SurveyRatings:
    """The ratings of a tracker; empty where the survey has none."""

    occlusion: str = ""
    targets: str = ""
    identities: str = ""
    real_time: str = ""


WORDS = {
    "klt": SurveyRatings("No", "Yes", "No", "Yes"),
    "mean-shift": SurveyRatings("No", "No", "No", "Yes"),
    "kalman": SurveyRatings("Some", "No", "No", "Yes"),
    "particle": SurveyRatings("Some", "Yes", "No", "Yes"),
    "mcmc": SurveyRatings("Some", "Yes", "No", "Yes"),
    "track-graph": SurveyRatings("Some", "Yes", "Yes", "No"),
}
