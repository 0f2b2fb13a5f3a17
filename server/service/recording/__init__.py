"""The recording on the disk: written GOP by GOP, found again by pulse, and deleted when it is too old."""
