"""``myview doctor``: checks of a configuration against the machine and the cameras."""
