"""One file a firmware: what differs between PX4 and ArduPilot, as data and small functions."""
