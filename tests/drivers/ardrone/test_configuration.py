"""The configuration as text."""

from __future__ import annotations

import pytest

from kybflow.drivers.ardrone import at


def test_a_configuration_comes_back():
    values = {"general:num_version_soft": "2.4.8", "control:euler_angle_max": "2.0943952e-01"}
    assert at.read_configuration(at.write_configuration(values)) == values


@pytest.mark.parametrize(
    ("asked", "found", "same"),
    [
        ("TRUE", "TRUE", True), ("TRUE", "true", True), ("TRUE", "FALSE", False),
        ("3000", "3000", True), ("0.21", "2.1000001e-01", True), ("0.21", "2.2e-01", False),
        ("x", "3", False),
    ],
)  # fmt: skip
def test_a_value_that_is_read_back(asked, found, same):
    assert at.agrees(asked, found) is same


def test_an_identity_is_eight_digits():
    assert len(at.identity("kybflow")) == 8
