"""H.264 parsing and writing (ITU-T H.264)."""
