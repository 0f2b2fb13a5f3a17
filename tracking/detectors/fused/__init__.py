"""A network's boxes and the silhouettes of the foreground as hypotheses of one explanation."""
