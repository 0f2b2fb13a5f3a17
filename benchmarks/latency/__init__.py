"""Latency from the pulse to the browser, by stage."""
