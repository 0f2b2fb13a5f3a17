"""Splices, viewers and their delay, beside other servers."""
