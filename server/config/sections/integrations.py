"""The sections `mqtt` and `webhooks`: other systems that get its state and events."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Self

from pydantic import Field, model_validator

from server.config.sections.base import Identifier, Port, Section, matching

Topic = Annotated[
    str,
    Field(max_length=100),
    matching(
        r"[A-Za-z0-9_-]+(/[A-Za-z0-9_-]+)*",
        "is not a topic such as home/cameras: letters, digits, _ and -, between slashes",
    ),
]

WebhookUrl = Annotated[
    str, matching(r"https?://[^\s/?#]+(/[^\s#]*)?", "is not an address such as https://example.org/hook")
]


class MqttSettings(Section):
    """The connection to an MQTT broker, and Home Assistant's discovery."""

    host: Annotated[str, matching(r"[^\s/@]+", "is not the name or address of a host")] | None = None
    """Name or address of the broker; None: no MQTT."""
    port: Port = 1883
    username: str | None = None
    password: Path | None = None
    """A file whose one line is the password."""
    tls: bool = False
    """Encrypt, and check the broker's certificate."""
    authority: Path | None = None
    """PEM: the authority that has signed it; None: those that the machine trusts. Needs `tls`."""
    topic: Topic = "myview"
    """Topics begin with it and the site's name."""
    discovery: Topic | None = "homeassistant"
    """Home Assistant's discovery prefix; None: no discovery messages."""
    pictures_every_s: Annotated[float, Field(ge=0, le=86_400)] = 10.0
    """Seconds between two pictures of the best view of each named person; 0: none."""
    operate: bool = False
    """Who may publish to the broker may switch recording off and on."""

    @model_validator(mode="after")
    def _is_whole(self) -> Self:
        if self.password is not None and self.username is None:
            raise ValueError("password: needs username")
        if self.authority is not None and not self.tls:
            raise ValueError("authority: needs tls: true")
        return self


class WebhookSettings(Section):
    """An address to which events are posted, signed by Standard Webhooks 1.0."""

    url: WebhookUrl
    secret: Path | None = None
    """A file whose one line, whsec_ and base64, signs what is posted; None: not signed."""
    rules: list[Identifier] = []
    """The rules whose events are posted; empty: all."""
    pictures: bool = True
    """With the small picture, as a data URL."""
