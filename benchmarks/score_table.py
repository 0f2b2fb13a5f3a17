"""Scores of tracks as cells of a table."""

from __future__ import annotations

from tracking.evaluation import Scores

_SHOWN = {
    "hota": "HOTA",
    "deta": "DetA",
    "assa": "AssA",
    "mota": "MOTA",
    "idf1": "IDF1",
    "recall": "Rcll",
    "precision": "Prcn",
    "switches": "IDSW",
    "tracks": "IDs",
    "objects": "GT",
}

HEADINGS = tuple(_SHOWN.values())


def cells(scores: Scores) -> list[str]:
    """Give the numbers under the headings: shares in percent."""
    values = [getattr(scores, name) for name in _SHOWN]
    return [f"{value}" if isinstance(value, int) else f"{100 * value:.1f}" for value in values]
