"""How well a view shows a person: the terms, each by itself, and all of them weighed into one quality."""

from bestview.quality.combination import Looks, Quality, Seen, view_quality
from bestview.quality.settings import QualitySettings
from bestview.quality.size import size_quality
from bestview.quality.view_costs import HIDDEN_COST, compared, compared_views, view_cost

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
