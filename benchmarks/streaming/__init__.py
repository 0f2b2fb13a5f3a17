"""Streaming: cost of splices and viewers and their delay, compared with other servers."""
