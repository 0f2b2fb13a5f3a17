"""Python imports this at its start where the folder is on its path: the process then counts its tasks."""

import os
import sys

if "server.cli.main" in sys.orig_argv:
    from benchmarks.soak.task_counts import FOLDER_VARIABLE, note_tasks

    note_tasks(os.environ[FOLDER_VARIABLE])
