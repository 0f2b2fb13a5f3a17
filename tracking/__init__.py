"""Frames or detections in, tracks out: detectors, the network model, its solvers, the online window."""

from tracking.appearance import histograms
from tracking.interpolation import between
from tracking.model.network import Network, build_network
from tracking.model.object_state import Template
from tracking.model.settings import PAPER_COSTS, CostSettings
from tracking.solvers.base import DEFAULT_SOLVER, Solution, Solver, SolveReport, solver_named, solver_names
from tracking.template_tracker import TemplateTracker
from tracking.tracker import OnlineTracker
from tracking.types import Detections
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
