"""``myview status``: the status of a running site in the terminal."""
