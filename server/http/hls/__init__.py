"""HTTP Live Streaming (RFC 8216): the newest of a stream, and its past."""
