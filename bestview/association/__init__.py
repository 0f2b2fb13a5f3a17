"""Association across cameras: tracklets, their affinity, clustering, and one id per person.

`IdentityRegistry` is the entry point. `TrackletSplitter` splits the cameras' tracks where a tracker may have
confused people, `affinity` and `appearance` add up evidence about pairs of tracklets, `cluster` groups them
into persons, and `registry` assigns, corrects and remembers person ids.
"""

from bestview.association.registry.corrections import IdentityUpdate, Merge, Split
from bestview.association.registry.identity_registry import IdentityRegistry
from bestview.association.registry.other_sites import SINGLE_SITE, IdSeries, SiteSighting
from bestview.association.registry.person import Person
from bestview.association.settings import IdentitySettings
from bestview.association.sightings import AppearanceHistogram, TrackUpdate
from bestview.association.tracklet import TrackKey, TrackletKey

__all__ = [
    "SINGLE_SITE",
    "AppearanceHistogram",
    "IdSeries",
    "IdentityRegistry",
    "IdentitySettings",
    "IdentityUpdate",
    "Merge",
    "Person",
    "SiteSighting",
    "Split",
    "TrackKey",
    "TrackUpdate",
    "TrackletKey",
]
