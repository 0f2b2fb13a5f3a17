"""A tank of fish of identical appearance, after the thesis of Todor (2009), section 8.1."""

from synthetic.tank.tank_world import VIEWPOINTS, TankWorld

__all__ = ["VIEWPOINTS", "TankWorld"]
