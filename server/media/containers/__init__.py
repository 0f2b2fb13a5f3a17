"""Containers: fragmented MP4, MPEG-TS, WebM."""
