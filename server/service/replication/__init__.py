"""Several best-view services of a site agree on who is who; one that starts takes over their state."""
