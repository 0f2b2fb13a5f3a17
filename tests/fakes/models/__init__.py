"""Models as files, and what they compute."""
