"""Somebody's word that two tracks have exchanged their people."""

from __future__ import annotations

from collections.abc import Container

from bestview.association.keys import EpisodeKey, TrackKey
from bestview.association.tracklet import Episode
from bestview.association.tracklet_splitter import Episodes


def exchange(
    episodes: Episodes,
    people: Container[int],
    tracks: tuple[TrackKey, TrackKey],
    frame: int,
    numbers: tuple[int, int],
) -> dict[EpisodeKey, tuple[int, int]]:
    """Let each of two tracks go on, from a frame, from what the other one was before.

    The part of a track that began in that frame or later becomes that of the other's person. Where a track
    was not cut since, the next sighting begins a part of it. Other cameras' parts that began since, and were
    taken for one of the two by what these tracks showed, are the other one's, too.

    Args:
        episodes: all of them; those that change are changed.
        people: the numbers of those who are remembered.
        tracks: of one camera.
        frame: the first in which each of the two shows the other's person.
        numbers: of whom they showed before it, where that is settled and over.

    Returns:
        The number of each episode that has another one now, before and after; of a track that is cut only
        later as if an episode had begun in that frame. Nothing where one of the two was nobody.
    """
    one, two = (episodes.before(track, frame, number) for track, number in zip(tracks, numbers, strict=True))
    if one is None or two is None:
        return {}
    first, second = _number_of(one, people), _number_of(two, people)
    if not first or not second or first == second:
        return {}
    changed, false = {}, 0
    for track, own, other, number in ((tracks[0], one, two, second), (tracks[1], two, one, first)):
        now = episodes.since(track, frame)
        was = _number_of(own if now is None else now, people)
        false += was == first + second - number
        if was and was != number:
            changed[EpisodeKey(*track, frame) if now is None else now.key] = was, number
        if now is None:
            episodes.cut(track, number, other)
        else:
            now.goes_on_as(number, other)
    if false == len(tracks):
        for episode in episodes.open:
            was = episode.number
            if episode.begin.frame >= frame and was in {first, second} and episode.key.track not in tracks:
                episode.become(first + second - was)
                changed[episode.key] = was, episode.number
    return changed


def _number_of(episode: Episode, people: Container[int]) -> int:
    """Give whose an episode is, settled or not; 0: nobody's who is remembered."""
    number = episode.firm or episode.number or episode.mostly
    return number if number in people else 0
