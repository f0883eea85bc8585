"""What an emulated autopilot believes of itself, from its simulated sensors."""
