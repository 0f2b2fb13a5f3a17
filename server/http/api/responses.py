"""From the service's state to the API's answers."""

from __future__ import annotations

import time

from server.http.api.schema import CameraInfo, Cameras, Choice, Elsewhere, ObjectInfo, Objects, SiteInfo
from server.service.decision_state import reason
from server.service.identity.sharding import shard_address
from server.service.ingest.ingest import CameraState, Thumbnail
from server.service.service import BestViewService


def site_info(service: BestViewService) -> SiteInfo:
    """Describe the site."""
    config = service.config
    return SiteInfo(
        name=config.site.name,
        fps=config.site.fps,
        width=config.site.width,
        height=config.site.height,
        gop=config.encode.gop,
        lookahead_frames=service.decider.view.lookahead,
        codec=service.agreement.codec,
        container=service.agreement.container,
        sound=None if service.sound is None else service.sound.format.codec,
        pulse0=service.pulse0,
        now=time.time(),
        cameras=list(config.camera_ids),
    )


def objects_info(service: BestViewService) -> Objects:
    """List everybody who has a stream, in the order of their numbers."""
    people, pictures = service.decider.people, _thumbnails(service)
    objects = []
    for number, standing in sorted(service.board.standings.items()):
        thumbnail = _newest(service, number, pictures.get(number, []))
        objects.append(
            ObjectInfo(
                object=number,
                name=people.roll.names.get(number),
                also=people.roll.also(number),
                first_seen=people.roll.first_seen.get(number, standing.first),
                last_seen=people.roll.last_seen.get(number, standing.first),
                visible=bool(standing.cameras),
                camera=standing.choice.camera,
                cameras=list(standing.cameras),
                thumbnail=None if thumbnail is None else f"objects/{number}/thumb.jpg?v={thumbnail.pulse}",
            )
        )
    share = service.config.view.share
    return Objects(objects, [Elsewhere(it, shard_address(it, share)) for it in people.elsewhere])


def cameras_info(service: BestViewService) -> Cameras:
    """List all cameras."""
    return Cameras([camera_info(service, *it) for it in service.intake.states.items()])


def camera_info(service: BestViewService, camera: str, state: CameraState) -> CameraInfo:
    """Say how a camera is."""
    status = state.status
    return CameraInfo(
        camera=camera,
        state=state.word,
        pulse=service.frame_buffers[camera].newest,
        late=service.aligner.late_messages[camera],
        fps=status.fps if status else 0.0,
        missed=status.missed if status else 0,
        shed=status.shed if status else 0,
        load_level=status.load_level if status else 0,
        in_step=status.in_step if status else False,
        message=state.message,
    )


def choice_info(service: BestViewService, number: int, pulse: int | None = None) -> Choice | None:
    """Explain an object's newest view, or that at a pulse; None: there is none, or it is not kept."""
    explained = service.board.explain(number, pulse)
    if explained is None:
        return None
    standing, why = explained.standing, explained.why
    return Choice(
        object=standing.choice.number,
        first=standing.first,
        frames=standing.frames,
        camera=standing.choice.camera,
        since=standing.since,
        costs={camera: view.cost for camera, view in why.views.items()},
        seen={camera: view.seen for camera, view in why.views.items()},
        quality={camera: view.quality for camera, view in why.views.items()},
        terms={camera: view.terms for camera, view in why.views.items()},
        unfound={camera: view.unfound for camera, view in why.views.items()},
        unfound_quality={camera: view.unfound_quality for camera, view in why.views.items()},
        weights=why.weights,
        before=standing.choice.before,
        lookahead=why.frames,
        switch_cost=why.switch_cost,
        stay=why.stay,
        cut=why.cut,
        cut_to=why.cut_to,
        reason=reason(standing.choice, why),
    )


def thumbnail_of(service: BestViewService, number: int) -> Thumbnail | None:
    """Give the newest small picture of a person, from the chosen camera where it has a recent one."""
    return _newest(service, number, _thumbnails(service).get(number, []))


def _thumbnails(service: BestViewService) -> dict[int, list[tuple[str, Thumbnail]]]:
    """Give everybody's small pictures by number, each with its camera."""
    found: dict[int, list[tuple[str, Thumbnail]]] = {}
    for (camera, boot, track), thumbnail in service.intake.thumbnails.items():
        number = service.decider.people.whose(camera, boot, track, thumbnail.pulse)
        if number is not None:
            found.setdefault(number, []).append((camera, thumbnail))
    return found


def _newest(service: BestViewService, number: int, own: list[tuple[str, Thumbnail]]) -> Thumbnail | None:
    if not own:
        return None
    standing = service.board.standings.get(number)
    chosen = standing.choice.camera if standing else None
    recent = max(thumbnail.pulse for _, thumbnail in own) - round(3 * service.config.site.fps)
    return max(own, key=lambda it: (it[0] == chosen and it[1].pulse >= recent, it[1].pulse))[1]
