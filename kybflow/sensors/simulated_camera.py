"""The cameras of a simulated vehicle: frames of the world's tags, drawn without a graphics card.

Each camera of the vehicle takes frames at its own rate. A frame is drawn when it arrives, `latency`
after the middle of its exposure: with lens distortion, motion blur, defocus, a rolling shutter and
noise. A late reader gets the newest frame of each camera; older ones are lost, as with a real
camera. Obstacles and a released payload hide what is behind them. The seed determines which tags
are covered, missing or misplaced; and, unless the world is calm, the errors of lens, mount, tags
and stamps (`kybflow.vision.rendering.miscalibrated`).
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence
from math import ceil
from typing import TYPE_CHECKING, NamedTuple

from kybflow.core.errors import DriverError
from kybflow.core.geometry import add, distance, integrate, rotate, scale
from kybflow.core.params import param, params
from kybflow.core.signals import NS, Frame, Measurement, Time, Truth
from kybflow.core.units import RATIO, Duration, format_quantity
from kybflow.parts import Link, Objection, Sensor, Stream
from kybflow.parts.link import is_calm, view_source
from kybflow.parts.sensor import frames_of
from kybflow.vision import OPENCV, WAY_OUT
from kybflow.world.cameras import SOUND, CalibrationErrors, Camera, Optics, Weakness
from kybflow.world.vehicle_context import LEGS, VehicleContext

if TYPE_CHECKING:
    import random

    from kybflow.vision.rendering.drawing import Room

_ON_BOARD = 0.02
"""Distance from its position on board within which a payload counts as carried, metres."""

_FEW = 0.1
"""The share of tags that leaves a vehicle without any for most of its way."""


@params
class SimulatedCameraParams(CalibrationErrors, Optics):
    latency: Duration = param(
        "Time from the middle of a frame's exposure to its arrival.",
        default=0.04, at_least=0.0, at_most=1.0,
    )  # fmt: skip
    calm: bool | None = param(
        "No errors of lens, mount, tags and stamps: sets `focal_error` to `stamp_error` to zero. By"
        " default as in the vehicle's driver.",
        default=None, read_only=True,
    )  # fmt: skip


class SimulatedCamera(Sensor[SimulatedCameraParams]):
    provides = frozenset({Frame})
    packages = OPENCV
    simulated = True

    @classmethod
    def objection(
        cls, params: SimulatedCameraParams, cameras: Mapping[str, Camera]
    ) -> Objection | None:
        left = (1.0 - params.covered) * (1.0 - params.missing)
        if left > _FEW:
            return None
        parameter = "covered" if params.covered >= params.missing else "missing"
        reason = f"only {format_quantity(round(left, 3), RATIO)} of the tags can be seen"
        return Objection(parameter, reason, f"write less, such as `{parameter}: 20 %`", True)

    @classmethod
    def claims(cls, params: SimulatedCameraParams, cameras: Mapping[str, Camera]) -> Sequence[str]:
        return frames_of(cameras)

    @classmethod
    def open(
        cls,
        params: SimulatedCameraParams,
        context: VehicleContext,
        link: Link,
        generator: random.Random,
    ) -> Frames:
        if not context.cameras:
            raise DriverError(f"the vehicle `{context.vehicle}` has no camera to take frames with")
        try:
            from kybflow.vision.rendering.drawing import Room
            from kybflow.vision.rendering.miscalibrated import Setup, miscalibrated
        except ImportError as error:
            raise DriverError(f"a simulated camera needs OpenCV ({error}); {WAY_OUT}") from None
        side = 0.0 if context.payload is None else context.payload.size
        seed = generator.getrandbits(64)
        setup = Setup(context.tags, tuple(context.cameras.values()), 0.0)
        if not (is_calm(link) if params.calm is None else params.calm):
            setup = miscalibrated(setup, params, seed)
        room = Room(setup.tags, params, seed, context.obstacles, side)
        latency, late = round(params.latency * NS), round(setup.stamps * NS)
        return Frames(room, setup.cameras, link, latency, late, side)


class _Exposure(NamedTuple):
    """A frame that has not arrived yet, with the body's state and the camera's faults at its
    exposure."""

    time: Time
    camera: Camera
    body: Truth
    weakness: Weakness


class Frames(Stream):
    """The frames of a vehicle's cameras, with the link's faults at the time of their exposure. A
    frame is drawn only when it is read. latency: from the middle of a frame's exposure to its
    arrival. late: error of the frames' time stamps. parcel: side of the payload, metres."""

    def __init__(
        self,
        room: Room,
        cameras: Sequence[Camera],
        link: Link,
        latency: Time,
        late: Time,
        parcel: float,
    ) -> None:
        self._room, self._cameras, self._link = room, cameras, link
        self._latency, self._late, self._parcel = latency, late, parcel
        self._view = view_source(link)
        self._counts = [0] * len(cameras)
        self._last: tuple[Time, Truth] | None = None
        self._taken: deque[_Exposure] = deque()

    def read(self, now: Time) -> Sequence[Measurement]:
        truth = self._view()
        if truth is None:
            return ()
        if self._last is None:
            self._counts = [ceil(now / NS * camera.rate) for camera in self._cameras]
        self._take(now, truth)
        self._last = (now, truth)
        newest: dict[str, _Exposure] = {}
        while self._taken and self._taken[0].time + self._latency <= now:
            taken = self._taken.popleft()
            newest[taken.camera.name] = taken
        arrived: list[Measurement] = []
        for time, camera, body, weakness in newest.values():
            seen_at = add(body.position, weakness.offset)
            image = self._room.draw(camera, body._replace(position=seen_at), weakness)
            arrived.append(Frame(max(0, time + self._late), camera.name, image))
        faults = self._link.faults
        return arrived if faults is None else faults.filtered(arrived)

    def trouble(self) -> str | None:
        if self._view() is None:
            return "the vehicle's position in the simulator is unknown; use a simulated vehicle"
        return None

    def close(self) -> None:
        self._taken.clear()

    def _take(self, now: Time, truth: Truth) -> None:
        """Queue every frame that is due by `now`, with the body's state extrapolated from the
        nearest tick."""
        before, known = self._last or (now, truth)
        taken: list[_Exposure] = []
        for i, camera in enumerate(self._cameras):
            while (at := round(self._counts[i] * NS / camera.rate)) <= now:
                since, body = (now, truth) if now - at <= at - before else (before, known)
                t = (at - since) / NS
                body = _with_visible_payload(body, self._parcel)._replace(
                    position=add(body.position, scale(body.velocity, t)),
                    attitude=integrate(body.attitude, body.angular_velocity, t),
                )
                faults = self._link.faults
                weakness = SOUND if faults is None else faults.camera
                taken.append(_Exposure(at, camera, body, weakness))
                self._counts[i] += 1
        self._taken.extend(sorted(taken, key=lambda frame: frame.time))


def _with_visible_payload(body: Truth, side: float) -> Truth:
    """Return the body with its payload as cameras see it: None while on board, otherwise raised by
    `LEGS`, since the room's floor is at z = 0."""
    if body.payload is None:
        return body
    on_board = add(body.position, rotate(body.attitude, (0.0, 0.0, 0.5 * side - LEGS)))
    if distance(body.payload, on_board) < _ON_BOARD:
        return body._replace(payload=None)
    return body._replace(payload=add(body.payload, (0.0, 0.0, LEGS)))
