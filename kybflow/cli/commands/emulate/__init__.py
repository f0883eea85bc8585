"""Emulate vehicles for any client."""

COMMANDS = ("ardrone", "autopilot")
