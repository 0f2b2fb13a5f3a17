"""Temporal consistency from above: who is mistaken after a merge, and what pruning saves."""
