"""The words of the survey's Table 1, for the columns that are measured (Todor 2009, section 7.5)."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Words:
    """One tracker's row; empty where the survey has none."""

    occlusion: str = ""
    targets: str = ""
    identities: str = ""
    real_time: str = ""


WORDS = {
    "klt": Words("No", "Yes", "No", "Yes"),
    "mean-shift": Words("No", "No", "No", "Yes"),
    "kalman": Words("Some", "No", "No", "Yes"),
    "particle": Words("Some", "Yes", "No", "Yes"),
    "mcmc": Words("Some", "Yes", "No", "Yes"),
    "track-graph": Words("Some", "Yes", "Yes", "No"),
}
