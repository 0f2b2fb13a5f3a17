"""The file that set-up writes is read by `myview up`; the earlier one and passwords are kept safe."""

from __future__ import annotations

import stat
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from server.config.camera_password import fill_in_password
from server.config.loader import load_config
from server.setup.camera_address import parse_address
from server.setup.proposal import SiteProposal, propose_site
from server.setup.site_file import NewCamera, NewSite, write_site
from server.setup.trial_messages import StreamTrial
from server.system.errors import UserError

SECRET = "p@ss: {word} #1"  # noqa: S105 — of a camera that does not exist
CAMERAS = (
    NewCamera("door", parse_address("rtsp://10.0.0.11/live", "viewer", SECRET), "h264 1920x1080, 25 fps"),
    NewCamera("desk", parse_address("/dev/video0")),
)
SITE = NewSite("hall", SiteProposal(12.5, 640, 360), CAMERAS)


def test_a_site_that_was_set_up_is_read_as_it_was_entered(tmp_path: Path) -> None:
    path = tmp_path / "site.yaml"
    assert write_site(SITE, path) is None
    config = load_config(path)
    assert (config.site.name, config.site.fps, config.site.size) == ("hall", 12.5, (640, 360))
    assert config.camera_ids == ("door", "desk")
    assert fill_in_password(config, "door").camera("door").source == CAMERAS[0].address.with_password
    assert config.camera("door").options == {"rtsp_transport": "tcp"}
    assert "# h264 1920x1080, 25 fps" in path.read_text()


def test_passwords_are_only_in_private_files(tmp_path: Path) -> None:
    path = tmp_path / "site.yaml"
    write_site(SITE, path)
    secret = tmp_path / "site.passwords" / "door"
    assert "word" not in path.read_text().replace("password", "")
    assert secret.read_text() == f"{SECRET}\n"
    modes = [stat.S_IMODE(file.stat().st_mode) for file in (path, secret, secret.parent)]
    assert modes == [0o600, 0o600, 0o700]


def test_the_earlier_file_is_kept(tmp_path: Path) -> None:
    path = tmp_path / "site.yaml"
    path.write_text("# mine\n")
    first = write_site(SITE, path)
    second = write_site(SITE, path)
    assert first is not None
    assert second is not None
    assert first.read_text() == "# mine\n"
    assert first != second
    assert load_config(second) == load_config(path)


def test_an_invalid_site_replaces_nothing(tmp_path: Path) -> None:
    path = tmp_path / "site.yaml"
    path.write_text("# mine\n")
    with pytest.raises(UserError, match=r"site\.width"):
        write_site(NewSite("hall", SiteProposal(25, 641, 360), CAMERAS), path)
    assert path.read_text() == "# mine\n"
    assert list(tmp_path.iterdir()) == [path]


TRIALS = st.builds(
    StreamTrial,
    width=st.integers(16, 8000),
    height=st.integers(16, 8000),
    fps=st.sampled_from([0, 5, 12.5, 25, 60]),
)


@given(st.lists(TRIALS, max_size=6))
def test_every_proposal_is_valid_and_enlarges_no_camera(trials: list[StreamTrial]) -> None:
    proposal = propose_site(trials)
    assert 0 < proposal.fps <= 25
    for side, most in ((proposal.width, 1280), (proposal.height, 720)):
        assert side % 2 == 0
        assert 16 <= side <= most
    for trial in trials:
        assert proposal.width <= trial.width or proposal.height <= trial.height
