"""Find autopilots, and set their parameters."""

COMMANDS = ("listen", "setup")
