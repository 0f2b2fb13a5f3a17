"""What is wrong with a camera's picture: it is covered, turned away, blurred, noisy or frozen."""

from tracking.picture_condition.monitor import PictureMonitor
from tracking.picture_condition.rectangles import cell_rectangles, cells_of
from tracking.picture_condition.reference import CONDITIONS

__all__ = ["CONDITIONS", "PictureMonitor", "cell_rectangles", "cells_of"]
