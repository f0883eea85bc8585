"""Meet an autopilot: hear it, and set its parameters."""

COMMANDS = ("listen", "setup")
