"""Scores as people read them."""

from __future__ import annotations

from collections.abc import Iterable

from tracking.evaluation.scores import Scores

HEADINGS = {
    "hota": "HOTA",
    "deta": "DetA",
    "assa": "AssA",
    "mota": "MOTA",
    "idf1": "IDF1",
    "recall": "Rcll",
    "precision": "Prcn",
    "switches": "IDSW",
    "fragments": "Frag",
    "objects": "GT",
    "tracks": "IDs",
}
"""MOTChallenge's headings by the scores' names, in the order of a table."""


def cells(scores: Scores, names: Iterable[str]) -> list[str]:
    """Give some of the scores as text: counts as they are, shares in percent."""
    values = (getattr(scores, name) for name in names)
    return [f"{value}" if isinstance(value, int) else f"{100.0 * value:.1f}" for value in values]
