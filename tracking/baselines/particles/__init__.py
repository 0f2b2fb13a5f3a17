"""Particle filters and Markov chains over the boxes of one or of all targets."""
