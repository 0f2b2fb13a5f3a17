"""Affinity: the log-likelihood ratio of two tracklets being one person, from all evidence about them."""
