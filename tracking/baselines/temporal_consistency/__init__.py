"""Temporal consistency: people are assigned to foreground blobs, jointly over a window of a few seconds.

R. Y. Khalaf and S. S. Intille, *Improving Multiple People Tracking Using Temporal Consistency*, MIT technical
report, 2001. Section numbers in this package are the report's. The tracker is in `tracker.py`;
importing the settings does not load it.
"""

from tracking.baselines.temporal_consistency.settings import BlobSettings, TemporalSettings

__all__ = ["BlobSettings", "TemporalSettings"]
