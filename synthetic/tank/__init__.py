"""A tank of fish that all look the same, after the thesis of Todor (2009), section 8.1."""

from synthetic.tank.tank_world import VIEWPOINTS, TankWorld

__all__ = ["VIEWPOINTS", "TankWorld"]
