"""Media formats: H.264, VP8, audio, containers."""
