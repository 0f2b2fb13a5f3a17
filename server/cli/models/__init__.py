"""``myview models``: neural detectors that can be installed."""
