"""The network program of a window on the ground plane, divided into parts that have nothing in common."""
