"""Sealed lines: what was tampered with is not believed, and anybody can make them by what is documented."""

from __future__ import annotations

import hashlib
import hmac

import pytest
from hypothesis import given
from hypothesis import strategies as st

from camsync.seal import SealError, Seals, new_nonce


def test_lines_are_sealed_as_the_documents_say() -> None:
    """docs/reference/pulses.md."""
    password, name, servers, clients = "a password", "c0", "1" * 32, "2" * 32
    seals = Seals.of(password, name, (servers, clients))
    for way, seal in (("client", seals.client), ("server", seals.server)):
        about = f"myview pulses 2\n{way}\n{name}\n{servers}\n{clients}"
        key = hmac.new(hashlib.sha256(password.encode()).digest(), about.encode(), "sha256").digest()
        for number, line in enumerate((b"PING 1", b"WHO")):
            mac = hmac.new(key, number.to_bytes(8, "big") + line, "sha256").digest()[:16].hex()
            assert seal.sealed(line + b"\n") == line + b" mac=" + mac.encode() + b"\n"


LINES = st.lists(st.binary(max_size=30).filter(lambda it: not {*b"\r\n"} & {*it}), min_size=1, max_size=6)


@given(LINES, st.data())
def test_of_what_was_tampered_with_no_more_is_believed_than_came_before_it(
    lines: list[bytes], data: st.DataObject
) -> None:
    nonces = (new_nonce(), new_nonce())
    ours, theirs = (Seals.of("secret", "c0", nonces) for _ in range(2))
    sealed = ours.server.sealed(b"".join(line + b"\n" for line in lines)).splitlines()
    place = data.draw(st.integers(0, len(sealed) - 1))
    spoiled = data.draw(
        st.one_of(
            st.permutations(sealed),
            st.just(sealed[:place] + sealed[place + 1 :]),
            st.just([*sealed[: place + 1], sealed[place], *sealed[place + 1 :]]),
            st.tuples(st.integers(0, len(sealed[place]) - 1), st.integers(1, 255)).map(
                lambda it: [*sealed[:place], flipped(sealed[place], *it), *sealed[place + 1 :]]
            ),
            st.just([ours.client.sealed(b"PING 1\n")[:-1], *sealed]),
        )
    )
    opened = []
    try:
        for line in spoiled:
            opened.append(theirs.server.opened(line))  # noqa: PERF401 — as many as there are
    except SealError:
        same = next((at for at, (a, b) in enumerate(zip(spoiled, sealed, strict=False)) if a != b), None)
        assert opened == lines[: len(opened)]
        assert same is None or len(opened) <= same
    else:
        assert opened == lines[: len(opened)]
        assert spoiled == sealed[: len(spoiled)]


def flipped(line: bytes, place: int, bits: int) -> bytes:
    return line[:place] + bytes([line[place] ^ bits]) + line[place + 1 :]


@given(st.text(max_size=8), st.text(max_size=8), st.sampled_from(["c0", "c1"]), st.integers(0, 2))
def test_keys_are_of_one_password_one_user_one_pair_of_nonces_and_one_way(
    password: str, other: str, user: str, which: int
) -> None:
    nonces = ("1" * 32, "2" * 32)
    line = Seals.of(password, "c0", nonces).client.sealed(b"WHO\n")[:-1]
    theirs = [nonces, (nonces[1], nonces[0]), (nonces[0], nonces[0])][which]
    seals = Seals.of(other, user, theirs)
    if (password, "c0", nonces) == (other, user, theirs):
        assert seals.client.opened(line) == b"WHO"
    else:
        with pytest.raises(SealError):
            seals.client.opened(line)
    with pytest.raises(SealError):
        Seals.of(password, "c0", nonces).server.opened(line)
