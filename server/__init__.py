"""The processes: cameras, best-view service, HTTP, wiring, configuration and the command line."""
