"""VP8 parsing and writing (RFC 6386)."""
