"""The solvers of the tracking program against each other."""
