"""Audio formats: AAC and Opus."""
