"""The command line: `main` is the entry point; a module or folder for each command."""

import os
import signal
import sys

# One process per camera already uses the cores; matrices here are small, and threads only get in the way.
# This must be set before NumPy is imported.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# What runs until it is told to end may be told while it still loads, which takes a second on a busy machine:
# that is no failure either. And what is yet to be read need not be read again.
_SERVING = frozenset({"up", "demo", "sync", "camera", "bestview"})
if sys.argv[0].rpartition("/")[2] in {"-m", "myview"}:
    serves = bool(_SERVING.intersection(sys.argv[1:2]))
    # Ctrl-C would be answered with a traceback that says which library was just being loaded.
    if signal.getsignal(signal.SIGINT) == signal.default_int_handler:
        signal.signal(signal.SIGINT, (lambda *_: os._exit(0)) if serves else signal.SIG_DFL)
    if serves:
        signal.signal(signal.SIGTERM, lambda *_: os._exit(0))
    if serves and sys.argv[1] != "demo":
        signal.signal(signal.SIGHUP, signal.SIG_IGN)
