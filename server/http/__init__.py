"""HTTP on top of the best-view service: page, streams, API, events, metrics."""
