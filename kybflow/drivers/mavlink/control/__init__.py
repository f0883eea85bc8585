"""Commands to one autopilot, with retries until it obeys: offboard control with its modes, arming,
lift-off, setpoints, manual override and the payload.

This package only decides; it handles neither bytes (`transport`, `protocol`) nor reports
(`telemetry`). The link calls `offboard` once a tick.
"""
