"""How well a view shows a person: the terms, each by itself, and all of them weighed into one quality."""

from bestview.quality.combine import Looks, Quality, Seen, view_quality
from bestview.quality.compare import HIDDEN_COST, compared, compared_views, view_cost
from bestview.quality.settings import QualitySettings
from bestview.quality.size import size_quality

__all__ = [
    "HIDDEN_COST",
    "Looks",
    "Quality",
    "QualitySettings",
    "Seen",
    "compared",
    "compared_views",
    "size_quality",
    "view_cost",
    "view_quality",
]
