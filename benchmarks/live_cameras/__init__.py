"""Real-time tracking of live cameras, and its cost by stage."""
