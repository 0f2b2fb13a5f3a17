"""One script per table or figure; `python -m benchmarks` runs them all."""
