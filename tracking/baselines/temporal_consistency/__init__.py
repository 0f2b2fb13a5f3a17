"""Temporal consistency: who is in which blob, decided for everybody at once over some seconds.

R. Y. Khalaf and S. S. Intille, *Improving Multiple People Tracking Using Temporal Consistency*, MIT technical
report, 2001; its sections are the numbers in the docstrings here. The tracker is in `tracker.py`: who only
reads settings does not load it.
"""

from tracking.baselines.temporal_consistency.settings import BlobSettings, TemporalSettings

__all__ = ["BlobSettings", "TemporalSettings"]
