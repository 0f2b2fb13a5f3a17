"""The streams: the cameras' own frames, spliced, to any number of viewers."""
