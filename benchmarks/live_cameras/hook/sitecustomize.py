"""Python runs this at its start where the folder is on its path: camera processes then time their stages."""

import os
import sys

if "camera" in sys.orig_argv and "server.cli.main" in sys.orig_argv:
    from benchmarks.live_cameras.stage_times import FOLDER_VARIABLE, time_camera

    time_camera(os.environ[FOLDER_VARIABLE], sys.orig_argv[-1])
