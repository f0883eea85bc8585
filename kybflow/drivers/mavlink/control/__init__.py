"""What one autopilot is commanded to do, and the retries until it does: offboard control over
modes, arming, lift-off, setpoints, manual override and the payload.

Decisions are here; bytes (`transport`, `protocol`) and what was reported (`telemetry`) are not. The
link calls `offboard` once a tick.
"""
