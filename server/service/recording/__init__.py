"""The past: what was streamed, kept on the disk and for a moment in memory, and found again by pulse."""
