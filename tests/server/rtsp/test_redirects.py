"""Where the RTSP gateway follows a redirect of the best-view service, and where not."""

from __future__ import annotations

import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import suppress

import pytest

import server.rtsp.service_stream as opened
from fakes.timeouts import PATIENCE
from server.rtsp.service_stream import Service, ServiceAwayError

PATH, TOKEN = "/objects/1/best.mp4", "SECRET"
Answer = Callable[[str], bytes]
Serve = Callable[[Answer], str]


@pytest.fixture
def serve() -> Iterator[Serve]:
    """Return a function that runs a server whose answers depend on the request's target."""
    sockets: list[socket.socket] = []

    def run(server: socket.socket, answer: Answer) -> None:
        while True:
            try:
                connection, _ = server.accept()
            except OSError:
                return
            with connection:
                target = connection.recv(65_536).split(b" ")[1].decode()
                connection.sendall(answer(target))

    def start(answer: Answer) -> str:
        server = socket.create_server(("127.0.0.1", 0))
        sockets.append(server)
        threading.Thread(target=run, args=(server, answer), daemon=True).start()
        return f"http://127.0.0.1:{server.getsockname()[1]}/"

    yield start
    for each in sockets:
        each.shutdown(socket.SHUT_RDWR)
        each.close()


def redirect(location: str) -> bytes:
    return f"HTTP/1.1 307 Elsewhere\r\nLocation: {location}\r\nContent-Length: 0\r\n\r\n".encode()


def stream(_: str) -> bytes:
    return b"HTTP/1.1 200 OK\r\nConnection: close\r\n\r\nfilm"


def refuse(_: str) -> bytes:
    return b"HTTP/1.1 401 Unauthorized\r\nContent-Length: 0\r\n\r\n"


@pytest.mark.parametrize(
    "location",
    [
        "http://[/x",
        "http://exa mple/objects/1/best.mp4",
        "http://127.0.0.1:99999/objects/1/best.mp4",
        "file:///objects/1/best.mp4",
        "/my site/objects/1/best.mp4?token=SECRET",
        "/admin/restart?token=SECRET",
        "/objects/x/best.mp4",
        "/cameras/c1/live.mp4",
    ],
)
def test_other_addresses_are_not_asked(serve: Serve, location: str) -> None:
    targets: list[str] = []

    def answer(target: str) -> bytes:
        targets.append(target)
        return redirect(location) if len(targets) == 1 else stream(target)

    with pytest.raises(ServiceAwayError) as raised:
        Service(serve(answer)).open(PATH, TOKEN)
    assert len(targets) == 1
    assert TOKEN not in str(raised.value)


def test_a_person_is_followed_under_another_number_to_a_server_without_keep_alive(serve: Serve) -> None:
    there = serve(stream)
    here = serve(lambda _: redirect(f"{there}objects/7/best.mp4"))
    assert list(Service(here).open(PATH, None).blocks()) == [b"film"]


def test_an_answer_that_repeats_the_request_does_not_put_the_token_into_the_error(serve: Serve) -> None:
    with pytest.raises(ServiceAwayError) as raised:
        Service(serve(lambda target: f"GET {target} HTTP/1.1\r\n\r\n".encode())).open(PATH, TOKEN)
    assert TOKEN not in str(raised.value)


def test_a_token_that_only_another_service_refuses_is_not_wrong(serve: Serve) -> None:
    there = serve(refuse)
    with pytest.raises(ServiceAwayError, match="refuses the token"):
        Service(serve(lambda _: redirect(f"{there}objects/1/best.mp4"))).open(PATH, TOKEN)


@pytest.mark.parametrize("begin", ["", "HTTP/1.1 200 OK\r\n", "HTTP/1.1 307 Elsewhere\r\n"])
def test_an_answer_that_never_ends_is_given_up(monkeypatch: pytest.MonkeyPatch, begin: str) -> None:
    monkeypatch.setattr(opened, "_OPEN_S", 0.3)
    ended = threading.Event()
    with socket.create_server(("127.0.0.1", 0)) as server:

        def drip() -> None:
            connection, _ = server.accept()
            with connection, suppress(OSError):  # the client ends the connection
                connection.sendall(begin.encode())
                while not ended.wait(0.02):
                    connection.sendall(b"H")
            ended.set()

        threading.Thread(target=drip, daemon=True).start()
        with pytest.raises(ServiceAwayError, match=r"^its answer is not complete after 0\.3 s$"):
            Service(f"http://127.0.0.1:{server.getsockname()[1]}/").open(PATH, None)
        assert ended.wait(PATIENCE)
