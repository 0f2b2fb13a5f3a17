"""``myview evaluate``: tracks and view choices against ground truth."""
