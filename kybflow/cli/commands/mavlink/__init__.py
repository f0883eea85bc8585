"""Meet an autopilot: hear it, and set its parameters."""

COMMANDS = ("setup", "listen")
