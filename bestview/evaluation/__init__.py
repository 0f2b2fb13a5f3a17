"""How good view choices are, against ground truth."""
