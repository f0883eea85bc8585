"""The preflight checks of an autopilot: its readiness, the serial line to it, its parameters.

The link runs these checks once a tick before take-off; `kybflow mavlink setup` uses the same
required parameters. Nothing here is used in flight.
"""
