"""The RTSP gateway: takes the service's streams and gives them to RTSP clients, without re-encoding.

It runs on the system's Python, for which Debian packages GStreamer's RTSP server, and so imports only the
standard library, `gi`, itself, and modules that need no more.
"""

PORT_IN_USE = 3
"""Exit code."""
