"""The command line: `main` is the entry point; a module or folder for each command."""

import os
import signal
import sys

# One process per camera already uses all cores; matrices are small, so threads would only slow them down.
# This must be set before NumPy is imported.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# A service may receive SIGTERM or SIGINT while it loads, which takes a second on a busy machine: it exits
# with 0. SIGHUP is ignored, since the configuration has not been read yet.
_SERVING = frozenset({"up", "demo", "sync", "camera", "bestview"})
if sys.argv[0].rpartition("/")[2] in {"-m", "myview"}:
    serves = bool(_SERVING.intersection(sys.argv[1:2]))
    # Otherwise Ctrl-C would print a traceback of the library that is being loaded.
    if signal.getsignal(signal.SIGINT) == signal.default_int_handler:
        signal.signal(signal.SIGINT, (lambda *_: os._exit(0)) if serves else signal.SIG_DFL)
    if serves:
        signal.signal(signal.SIGTERM, lambda *_: os._exit(0))
    if serves and sys.argv[1] != "demo":
        signal.signal(signal.SIGHUP, signal.SIG_IGN)
