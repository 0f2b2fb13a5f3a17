"""View quality: how well a view shows a person, as the product of weighted terms."""

from bestview.quality.combination import (
    CameraLayout,
    QualitySettings,
    TrackWindow,
    ViewQuality,
    compute_view_quality,
)
from bestview.quality.framing import size_quality
from bestview.quality.view_costs import HIDDEN_COST, relative_quality, relative_view_quality, view_cost

__all__ = [
    "HIDDEN_COST",
    "CameraLayout",
    "QualitySettings",
    "TrackWindow",
    "ViewQuality",
    "compute_view_quality",
    "relative_quality",
    "relative_view_quality",
    "size_quality",
    "view_cost",
]
