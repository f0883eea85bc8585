"""What one autopilot is asked for: offboard control, modes, arming, take-off, commands and their
retries.
"""
