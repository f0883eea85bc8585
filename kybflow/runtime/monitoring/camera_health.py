"""What is wrong with a vehicle's cameras, told apart by the times and the images of their frames.

lost: no frame for longer than

    max(SILENT, 3 / rate),   rate = the camera's frames a second

froze: frames with fresh times whose image is the one before it, in the air, for longer than

    max(SAME, 1.5 / rate)

The noise of a sensor makes two equal images impossible, so 1,200 pixels or so of each are enough to
compare. An image of one brightness is none that froze: it is dark, or blinded. On the ground
nothing is said of it, as a simulated sensor without noise gives the same again while it stands.
recovered: so many good frames since one of these was told.

A camera counts from its first frame on. Why there was none, its sensor knows.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy

from kybflow.core.signals import NEVER, NS, Frame, Time
from kybflow.world.cameras import Camera

LOST, FROZE, RECOVERED = "camera_lost", "camera_froze", "camera_recovered"
SILENT, SAME = 0.15, 0.1
"""Seconds. Both are told before the estimate is a quarter of a second old, from 15 Hz on."""
GOOD = 3
_ACROSS = 40
"""Pixels of a row that are compared."""


class Finding(NamedTuple):
    """Something that was found of a camera. value, bound: seconds without a new frame or image;
    metres off. other: the vehicle whose place a camera shows."""

    event: str
    camera: str = ""
    value: float = 0.0
    bound: float = 0.0
    other: str = ""


class Cameras:
    """Those of one vehicle. due: when one of them is lost should nothing come. wrong: what was told
    last of each that has not recovered."""

    def __init__(self, cameras: Mapping[str, Camera]) -> None:
        self._cameras = cameras
        self._eyes: dict[str, _Eye] = {}
        self.due: Time = NEVER
        self.wrong: dict[str, str] = {}

    def judge(self, frames: Sequence[Frame], now: Time, in_air: bool) -> list[Finding]:
        """What is found with these new frames. To be asked whenever some have come, and without any
        from `due` on. in_air: whether the vehicle is."""
        findings: list[Finding] = []
        for frame in frames:
            eye = self._eyes.get(frame.camera)
            if eye is None:
                eye = self._eyes[frame.camera] = _Eye(self._cameras[frame.camera].rate)
            eye.heard = now
            self._look(frame, eye, in_air, findings)
        for name, eye in self._eyes.items():
            silence = (now - eye.heard) / NS
            if silence > eye.patience and self.wrong.get(name) != LOST:
                self._found(findings, Finding(LOST, name, silence, eye.patience))
                eye.good = 0
        waiting = (eye for name, eye in self._eyes.items() if self.wrong.get(name) != LOST)
        self.due = min((eye.heard + round(eye.patience * NS) for eye in waiting), default=NEVER)
        return findings

    def _look(self, frame: Frame, eye: _Eye, in_air: bool, findings: list[Finding]) -> None:
        name, wrong = frame.camera, self.wrong.get(frame.camera)
        if eye.repeats(frame) and (in_air or wrong == FROZE):
            since = (frame.time - eye.changed) / NS
            if since > eye.endurance and wrong != FROZE:
                self._found(findings, Finding(FROZE, name, since, eye.endurance))
            eye.good = 0
            return
        eye.changed = frame.time
        eye.good += 1
        if wrong is not None and eye.good >= GOOD:
            del self.wrong[name]
            findings.append(Finding(RECOVERED, name))

    def _found(self, findings: list[Finding], finding: Finding) -> None:
        self.wrong[finding.camera] = finding.event
        findings.append(finding)


class _Eye:
    """What is remembered of a camera. patience, endurance: seconds without a frame, or without a
    new image, at most. heard: when its last frame came. changed: when the last image was taken that
    was a new one. good: frames since something was wrong."""

    __slots__ = ("_sample", "changed", "endurance", "good", "heard", "patience")

    def __init__(self, rate: float) -> None:
        self.patience, self.endurance = max(SILENT, 3.0 / rate), max(SAME, 1.5 / rate)
        self.heard: Time = 0
        self.changed: Time = 0
        self.good = 0
        self._sample: Any = None

    def repeats(self, frame: Frame) -> bool:
        """Take note of a frame; whether its image is the one before it."""
        step = max(1, frame.image.shape[1] // _ACROSS)
        sample, last = frame.image[::step, ::step], self._sample
        if last is None or not numpy.array_equal(sample, last):
            self._sample = sample.copy()  # who took the image may write the next one over it
            return False
        return bool(sample.min() != sample.max())
