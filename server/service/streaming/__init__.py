"""Live streams: the cameras' encoded frames, spliced into a stream per person, for any number of viewers."""
