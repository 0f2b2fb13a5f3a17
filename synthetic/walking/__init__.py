"""How people walk: routes, gatherings, collision avoidance."""
