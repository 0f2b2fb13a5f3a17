"""The render worker: decodes, draws and encodes for one stream."""

from __future__ import annotations

from typing import BinaryIO

import cv2

from server.media.rendering_messages import RenderRequest, RenderSettings
from server.service.rendering.worker.stream_renderer import StreamRenderer
from server.system.worker.main import answer_requests, run_worker


def serve(requests: BinaryIO, answers: BinaryIO) -> None:
    """Render what is requested until the service closes the pipe, or ends."""
    answer_requests(
        requests, answers, RenderSettings, RenderRequest, lambda settings: StreamRenderer(settings).render
    )


def main() -> None:
    """Run the worker."""
    cv2.setNumThreads(1)
    run_worker("draw", serve)


if __name__ == "__main__":
    main()
