"""One camera's process: sources, encoding, detection, tracking, publishing."""
