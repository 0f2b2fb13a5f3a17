"""Frames or detections in, tracks out: detectors, the network model, its solvers, the online window."""

from tracking.appearance import histograms
from tracking.between import between
from tracking.costs import CostSettings
from tracking.detections import Detections
from tracking.network import Network, build_network
from tracking.presets import PAPER_COSTS
from tracking.solvers.base import (
    DEFAULT_SOLVER,
    Solution,
    Solver,
    SolveReport,
    solver_named,
    solver_names,
)
from tracking.template import Template
from tracking.template_tracker import TemplateTracker
from tracking.tracker import OnlineTracker
from tracking.window import Glimpse, WindowResult, WindowSettings, WindowTrack, joined

__all__ = [
    "DEFAULT_SOLVER",
    "PAPER_COSTS",
    "CostSettings",
    "Detections",
    "Glimpse",
    "Network",
    "OnlineTracker",
    "Solution",
    "SolveReport",
    "Solver",
    "Template",
    "TemplateTracker",
    "WindowResult",
    "WindowSettings",
    "WindowTrack",
    "between",
    "build_network",
    "histograms",
    "joined",
    "solver_named",
    "solver_names",
]
