"""PyPI's `pyardrone` takes an emulated drone for a real one."""

from __future__ import annotations

import threading
import warnings

import pytest
from served_drones import served
from waiting import until

with warnings.catch_warnings():
    warnings.simplefilter("ignore")
    pyardrone = pytest.importorskip("pyardrone", reason="pyardrone is not installed")

pytestmark = [pytest.mark.peer, pytest.mark.filterwarnings("ignore")]
LANDED, FLYING, HOVERING = 2, 3, 4


@pytest.fixture
def drone():
    with served() as drones:
        client = pyardrone.ARDrone(host=drones.host)
        try:
            yield client
        finally:
            client.close()


class Repeating:
    """Does something every 30 ms, as a program that flies must, until the block ends."""

    def __init__(self, action):
        self._action, self._over = action, threading.Event()
        self._thread = threading.Thread(target=self._run)

    def _run(self):
        while not self._over.wait(0.03):
            self._action()

    def __enter__(self):
        self._thread.start()

    def __exit__(self, *_):
        self._over.set()
        self._thread.join()


def test_it_connects_flies_lands_and_recovers_from_an_emergency(drone):
    def phase():
        return drone.navdata.demo.ctrl_state >> 16

    until(drone.navdata_ready.is_set, "navigation data")
    drone.send(pyardrone.at.CONFIG("general:navdata_demo", "FALSE"))
    until(lambda: hasattr(drone.navdata, "kalman_pressure"), "all options")
    assert phase() == LANDED
    with Repeating(drone.takeoff):
        until(lambda: phase() in (HOVERING, FLYING), "taken off")
    with Repeating(lambda: drone.move(forward=0.5, cw=0.5)):
        until(lambda: drone.navdata.demo.vx > 200, "forward")
        until(lambda: abs(drone.navdata.demo.psi) > 20_000, "turned")
    with Repeating(lambda: drone.move(up=0.5)):
        until(lambda: drone.navdata.demo.altitude > 1000, "climbed")
    with Repeating(drone.land):
        until(lambda: phase() == LANDED, "landed")
    with Repeating(drone.takeoff):
        until(lambda: drone.navdata.demo.altitude > 100, "rising")
    drone.emergency()
    until(lambda: drone.state.emergency_mask, "emergency")
    with Repeating(drone.land):
        until(lambda: drone.navdata.demo.altitude < 50, "on the ground")
        until(lambda: phase() == LANDED, "at rest")
    drone.emergency()
    until(lambda: not drone.state.emergency_mask, "recovered")
    drone.land()
    with Repeating(drone.takeoff):
        until(lambda: phase() == HOVERING, "flying again")
    with Repeating(drone.land):
        until(lambda: phase() == LANDED, "down")
