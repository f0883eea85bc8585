"""What must be right before an autopilot flies: its readiness, the line to it, its parameters.

The link asks for these checks once a tick before take-off; `kybflow mavlink setup` uses the same
required parameters. Nothing here is used in flight.
"""
