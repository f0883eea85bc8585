"""What the tests on real firmware are given; see docs/firmware.md."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

import pytest
from present import needed
from witness import Witness

BOTH = ("px4", "ardupilot")


@pytest.fixture(params=BOTH)
def two(request: pytest.FixtureRequest) -> str:
    """A firmware of which systems 1 and 2 are there."""
    needed({1: request.param, 2: request.param})
    name: str = request.param
    return name


@pytest.fixture
def beside() -> Iterator[Callable[[Mapping[int, str]], Witness]]:
    """Opens a second connection to those autopilots, by system id."""
    opened: list[Witness] = []

    def look(autopilots: Mapping[int, str]) -> Witness:
        opened.append(Witness(autopilots))
        return opened[-1]

    yield look
    for witness in opened:
        witness.close()
