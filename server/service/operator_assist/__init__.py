"""Operator assistance: flags of predicted tracking failures, and position corrections."""
