"""How long the pose from printed tags takes, against one call of OpenCV's detector on the
same frames.

    python bench/tags.py [--frames 60]

Flies a lively circle at 1.2 m over a floor of 100 tags of 19.5 cm, drawn with the default optics,
640 x 480 at 30 Hz. Each frame is located with the prediction that the last poses give, then the
same frame is given to a default `cv2.aruco.ArucoDetector`, so that whatever else the machine does
slows both; the ratio is of the medians. One thread. Then the same with 10,000 tags in the map, the
others out of view, and with no prediction at all.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator
from math import cos, pi, sin
from statistics import mean, median
from time import perf_counter
from typing import Any

import cv2
import numpy

from kybflow.core.geometry import LEVEL, conjugate, distance, from_euler, multiply, sub
from kybflow.core.signals import NS, Frame, Truth
from kybflow.vision.locating.locate import BodyMotion
from kybflow.vision.locating.locator import Locator, Prediction
from kybflow.vision.rendering.drawing import Room
from kybflow.vision.tags import FAMILIES, dictionary
from kybflow.world.cameras import Camera, Lens, Optics
from kybflow.world.tags import Tag, TagMap

OPTICS = Optics()
LENS = Lens(640, 480, 520.0, 520.0, 318.0, 243.0, (-0.12, 0.03, 0.0005, -0.0004, 0.0))
CAMERA = Camera("down", LENS, (0.08, 0.0, -0.03), row_time=OPTICS.row_time)
SIZE, PITCH, RATE = 0.195, 0.2077, 30.0
GOAL, GROWTH = 0.5, 1.1


def tags(columns: int, family: str, shift: float) -> list[Tag]:
    """A square of tags."""
    return [
        Tag(family, j * columns + i, SIZE, (shift + PITCH * i, shift + PITCH * j, 0.0), LEVEL)
        for j in range(columns)
        for i in range(columns)
    ]


def far_away(count: int) -> list[Tag]:
    """Tags out of view, of all other families. Their numbers go beyond what a family has, because
    that many tags there aren't; nothing looks at them."""
    families = sorted(FAMILIES.keys() - {"36h11"})
    return [
        Tag(family, n // len(families), SIZE, (x, y, 0.0), LEVEL)
        for n in range(count)
        for family in (families[n % len(families)],)
        for x, y in ((20.0 + PITCH * (n % 100), 20.0 + PITCH * (n // 100)),)
    ]


def pose_at(t: float) -> tuple[Any, Any]:
    a = 2.0 * pi * t / 8.0
    roll, pitch = 0.05 * sin(a) + 0.02 * sin(4.0 * t), -0.05 * cos(a) + 0.02 * cos(5.0 * t)
    place = (0.95 + 0.4 * cos(a), 0.95 + 0.4 * sin(a), 1.2 + 0.05 * sin(2.3 * a))
    return place, from_euler(roll, pitch, 0.4 * sin(a))


def truth_at(t: float, h: float = 1e-4) -> Truth:
    (p, q), (a, b), (c, d) = pose_at(t), pose_at(t - h), pose_at(t + h)
    x, y, z = (v / (2 * h) for v in sub(c, a))
    _, wx, wy, wz = multiply(conjugate(b), d)
    return Truth(p, (x, y, z), q, (wx / h, wy / h, wz / h))


def flight(room: Room, frames: int) -> Iterator[tuple[Frame, Truth, Prediction]]:
    """Frames with what a filter would predict of them: some millimetres and tenths of a degree
    off."""
    generator = numpy.random.default_rng(1)
    for n in range(frames):
        body = truth_at(n / RATE)
        ex, ey, ez = generator.normal(0.0, 0.004, 3).tolist()
        (px, py, pz), turn = body.position, from_euler(*generator.normal(0.0, 0.004, 3).tolist())
        motion = BodyMotion(body.velocity, body.angular_velocity)
        near = (px + ex, py + ey, pz + ez)
        prediction = Prediction(near, multiply(body.attitude, turn), motion, 0.01, 0.02)
        yield Frame(round(n / RATE * NS), "down", room.draw(CAMERA, body)), body, prediction


def timed(work: Callable[[], Any]) -> tuple[float, Any]:
    begin = perf_counter()
    result = work()
    return perf_counter() - begin, result


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=60)
    frames = parser.parse_args().frames
    cv2.setNumThreads(1)
    few = tags(10, "36h11", 0.0)
    maps = {"100 tags": TagMap(few), "10,000 tags": TagMap([*few, *far_away(9900)])}
    locators = {name: Locator(tag_map, {"down": CAMERA}) for name, tag_map in maps.items()}
    cold = Locator(maps["100 tags"], {"down": CAMERA})
    detector = cv2.aruco.ArucoDetector(dictionary("36h11"))
    times: dict[str, list[float]] = {name: [] for name in (*locators, "no prediction", "detector")}
    errors, used = [], []
    for frame, body, prediction in flight(Room(maps["100 tags"], OPTICS, 1), frames):
        for name, locator in locators.items():
            took, located = timed(lambda f=frame, p=prediction, o=locator: o.locate([f], p))
            times[name].append(took)
            errors.append(distance(located.position, body.position))
            used.append(len(located.used))
        times["no prediction"].append(timed(lambda f=frame: cold.locate([f], None))[0])
        times["detector"].append(timed(lambda f=frame: detector.detectMarkers(f.image))[0])
    whole = median(times["detector"])
    print(f"{'':16}{'ms a frame':>12}{'of the detector':>18}")
    for name, taken in times.items():
        print(f"{name:16}{1e3 * median(taken):12.1f}{median(taken) / whole:18.2f}")
    print(f"tags used: {mean(used):.1f}; error: mean {1e3 * mean(errors):.2f} mm", end=", ")
    print(f"most {1e3 * max(errors):.2f} mm")
    ratio = median(times["100 tags"]) / whole
    growth = median(times["10,000 tags"]) / median(times["100 tags"])
    print(f"pose over detector: {ratio:.2f} (goal {GOAL}); 10,000 over 100 tags: {growth:.2f}")
    return 0 if ratio <= GOAL and growth <= GROWTH else 1


if __name__ == "__main__":
    sys.exit(main())
