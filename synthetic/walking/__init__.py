"""Walking people: routes, gatherings, collision avoidance."""
