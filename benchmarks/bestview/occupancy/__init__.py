"""An occupancy map of the ground with shortest paths, the reference for several cameras at once."""
