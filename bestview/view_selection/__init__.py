"""View selection: the sliding-window dynamic program that selects each object's camera (section III).

`select_views` takes dense costs; `VisibleViews` holds a sparse list of views and sums its costs by GOP for
`select_views_by_gop`.
"""

from bestview.view_selection.dynamic_program import NO_CAMERA, NO_VIEW_COST, GopCosts
from bestview.view_selection.inferred_views import LastDetections, add_inferred_views, add_missed_detections
from bestview.view_selection.selection import ViewSelection, select_views, select_views_by_gop
from bestview.view_selection.sparse_costs import VisibleViews

__all__ = [
    "NO_CAMERA",
    "NO_VIEW_COST",
    "GopCosts",
    "LastDetections",
    "ViewSelection",
    "VisibleViews",
    "add_inferred_views",
    "add_missed_detections",
    "select_views",
    "select_views_by_gop",
]
