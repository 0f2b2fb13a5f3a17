"""Processes of a site: start-up, supervision, reload, shutdown, health checks."""
