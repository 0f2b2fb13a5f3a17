"""Operator assistance: flags of predicted tracking failures, and corrections by pointing."""
