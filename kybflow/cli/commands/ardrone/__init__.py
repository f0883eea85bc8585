"""Prepare an AR.Drone."""

COMMANDS = ("join",)
