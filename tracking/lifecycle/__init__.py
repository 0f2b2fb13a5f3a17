"""Track lifecycle: gating, initiation and termination."""
