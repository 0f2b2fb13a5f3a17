"""H.265 parsing and writing (ITU-T H.265)."""
