"""The sections of the configuration, one idea per file."""

from server.config.sections.access import AccessSettings
from server.config.sections.audio import SoundSettings
from server.config.sections.base import Endpoint, Identifier, PictureSide, Polygon, Port, Section
from server.config.sections.camera import CameraSettings, TrackSettings
from server.config.sections.encode import EncodeSettings
from server.config.sections.integrations import MqttSettings, WebhookSettings
from server.config.sections.output import HttpSettings, RecordSettings, TlsSettings
from server.config.sections.rtsp import RtspSettings
from server.config.sections.rules import RuleSettings, ZoneSettings, check_zones_and_rules
from server.config.sections.site import ProcessTlsSettings, SiteSettings, SyncSettings, ZenohSettings
from server.config.sections.sites import LinkSettings, SitesSettings, is_site_user, site_user
from server.config.sections.view import LIVE_VIEW_SETTINGS, FlagSettings, ShardingSettings, ViewSettings

__all__ = [
    "LIVE_VIEW_SETTINGS",
    "AccessSettings",
    "CameraSettings",
    "EncodeSettings",
    "Endpoint",
    "FlagSettings",
    "HttpSettings",
    "Identifier",
    "LinkSettings",
    "MqttSettings",
    "PictureSide",
    "Polygon",
    "Port",
    "ProcessTlsSettings",
    "RecordSettings",
    "RtspSettings",
    "RuleSettings",
    "Section",
    "ShardingSettings",
    "SiteSettings",
    "SitesSettings",
    "SoundSettings",
    "SyncSettings",
    "TlsSettings",
    "TrackSettings",
    "ViewSettings",
    "WebhookSettings",
    "ZenohSettings",
    "ZoneSettings",
    "check_zones_and_rules",
    "is_site_user",
    "site_user",
]
