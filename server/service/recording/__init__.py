"""The recording on the disk: written GOP by GOP, indexed by pulse, and deleted when it is too old."""
