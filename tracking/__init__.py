"""Multi-object tracking in one camera, as a linear program over a moving window.

Sub-packages: `detectors` (candidate boxes), `model` (the network and its costs), `solvers`, `lifecycle`
(gating, initiation, termination), `interactive` (risk prediction and operator corrections), `baselines`
(trackers from the literature) and `evaluation` (HOTA, MOTA, IDF1).
"""

from tracking.appearance import gray_histograms
from tracking.interpolation import interpolate_detections
from tracking.model.network import Network, build_network
from tracking.model.object_state import Template
from tracking.model.settings import PAPER_COSTS, CostSettings
from tracking.paper import PAPER, PAPER_CVPR, PaperPreset
from tracking.solvers.base import DEFAULT_SOLVER, Solution, Solver, SolveReport, create_solver, solver_names
from tracking.solvers.budget import SolverBudget
from tracking.template_tracker import TemplateTracker
from tracking.tracker import OnlineTracker
from tracking.types import Detections
from tracking.window import (
    AppearanceHistogram,
    ResolvedWindowSettings,
    WindowResult,
    WindowSettings,
    WindowTrack,
    merge_results,
)

__all__ = [
    "DEFAULT_SOLVER",
    "PAPER",
    "PAPER_COSTS",
    "PAPER_CVPR",
    "AppearanceHistogram",
    "CostSettings",
    "Detections",
    "Network",
    "OnlineTracker",
    "PaperPreset",
    "ResolvedWindowSettings",
    "Solution",
    "SolveReport",
    "Solver",
    "SolverBudget",
    "Template",
    "TemplateTracker",
    "WindowResult",
    "WindowSettings",
    "WindowTrack",
    "build_network",
    "create_solver",
    "gray_histograms",
    "interpolate_detections",
    "merge_results",
    "solver_names",
]
