"""Geometry of calibrated cameras: ground plane, projections between views, and detection probability."""
