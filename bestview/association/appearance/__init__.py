"""Appearance of people: mean color histograms, compared within a camera and between cameras."""
