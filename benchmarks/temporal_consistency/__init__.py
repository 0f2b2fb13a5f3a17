"""Temporal consistency in an overhead view: identity errors after merges, and the effect of pruning."""
