"""The video of an emulated drone: the world's tags and obstacles as one of its cameras sees them.

`video:video_channel` selects the camera: 0 is the airframe's `front`, 1 is `down`. Pictures are
drawn and encoded only while a client is connected, `RATE` times a second, each as a key frame, so
that a client may start with any.
"""

from __future__ import annotations

from collections.abc import Callable

from kybflow.core.errors import DriverError
from kybflow.core.signals import NS, Time, Truth
from kybflow.drivers.emulated_ardrone.drone import EmulatedConfiguration
from kybflow.vision import WAY_OUT as NO_OPENCV
from kybflow.vision.video import WAY_OUT as NO_PYAV
from kybflow.vision.video.pave import write_frame
from kybflow.world.cameras import Optics
from kybflow.world.vehicle_context import VehicleContext

RATE = 10
CHANNELS = ("front", "down")


class DroneVideo:
    """The video of one drone. Raises DriverError if a package is missing or the airframe has
    neither camera."""

    def __init__(
        self,
        context: VehicleContext,
        look: Callable[[], Truth],
        configuration: EmulatedConfiguration,
        seed: int,
    ) -> None:
        try:
            from kybflow.vision.rendering.drawing import Room
        except ImportError as error:
            raise DriverError(f"video needs OpenCV ({error}); {NO_OPENCV}") from None
        try:
            from kybflow.vision.video.codec import FrameEncoder
        except ImportError as error:
            raise DriverError(f"video needs PyAV ({error}); {NO_PYAV}") from None
        known = {name: context.cameras[name] for name in CHANNELS if name in context.cameras}
        if not known:
            raise DriverError(
                f"the airframe of `{context.vehicle}` has no camera `front` or `down`"
            )
        self._cameras = known
        self._encoders = {
            name: FrameEncoder(camera.lens.width, camera.lens.height, RATE)
            for name, camera in known.items()
        }
        self._room = Room(context.tags, Optics(), seed, context.obstacles)
        self._look, self._configuration = look, configuration
        self._due: Time = 0

    def due(self, now: Time) -> bytes:
        """Return the bytes to send now; empty between two pictures."""
        if now < self._due:
            return b""
        self._due = now + NS // RATE
        channel = int(self._configuration.number("video:video_channel"))
        wanted = CHANNELS[channel % len(CHANNELS)]
        name = wanted if wanted in self._cameras else next(iter(self._cameras))
        picture = self._room.draw(self._cameras[name], self._look())
        frames = self._encoders[name].encode(picture, now // 1_000_000)
        return b"".join(map(write_frame, frames))
