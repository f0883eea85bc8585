"""Stand in for something that isn't there."""

COMMANDS = ("ardrone", "autopilot")
