"""Starting things: the command line, the supervisor, and the offline way."""

import os

# One process per camera already uses the cores; matrices here are small, and threads only get in the way.
# It must be said before NumPy is imported.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
