"""Shared parts of the benchmarks: options, reports, recordings, browser, processor time."""
