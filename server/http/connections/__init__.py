"""HTTP connections: limits on their number, per network and in time."""
