"""What one autopilot is commanded to do, and the retries until it does it: offboard control with
its modes, arming, lift-off, setpoints, manual override and the payload.

This package only decides; it handles neither bytes (`transport`, `protocol`) nor reports
(`telemetry`). The link calls `offboard` once a tick.
"""
