"""``myview render``: recorded views processed offline, to files."""
