"""The pulse server's process."""

from __future__ import annotations

import errno
import logging

from camsync import PulseServer
from server.config.pulse_access import pulse_clients, pulse_server_tls, pulse_users
from server.config.running_config import ActiveConfig
from server.supervisor.exposure_checks import check_pulses
from server.supervisor.sighup import reloads
from server.supervisor.startup_signal import signal_started
from server.system.errors import UserError, reason_of

log = logging.getLogger(__name__)


async def sync_process(running: ActiveConfig) -> None:
    """Send pulses; pulse 0 waits for all cameras and best-view services.

    A reloaded configuration is only logged: none of its settings can change while it runs.

    Raises:
        UserError: the port cannot be listened on or is exposed, or passwords cannot be read.
    """
    config = running.now
    check_pulses(config)
    sync = config.sync
    server = PulseServer(
        config.site.fps,
        expect=pulse_clients(config),
        start_timeout=sync.start_timeout_s,
        host=sync.bind,
        port=sync.port,
        users=pulse_users(config),
        tls=pulse_server_tls(config),
    )
    try:
        await server.start()
    except OSError as error:
        in_use = error.errno == errno.EADDRINUSE
        reason = "the port is in use" if in_use else reason_of(error)
        raise UserError(f"sync.port: cannot listen on {sync.bind}:{sync.port}: {reason}") from error
    log.info("pulses at %g a second on %s:%d", config.site.fps, sync.bind, server.port)
    signal_started()
    try:
        async for reload in reloads(running):
            log.info("%s", reload.line)
    finally:
        await server.stop()
