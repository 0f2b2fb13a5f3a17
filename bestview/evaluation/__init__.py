"""Evaluation of view selections against ground truth."""
