"""What several benchmarks share: options, reports, recordings, browsers, processor time."""
