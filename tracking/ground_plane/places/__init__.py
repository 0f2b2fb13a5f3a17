"""Evidence of people on the plane: measurements of places, and hypotheses of who stands where."""
