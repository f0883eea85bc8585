"""What an emulated autopilot hears and says over MAVLink."""
