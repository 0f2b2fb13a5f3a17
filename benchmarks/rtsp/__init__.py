"""The RTSP gateway: which clients play, and what they see when something fails."""
