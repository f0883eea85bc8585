"""What an autopilot must say and how its parameters must be set before it flies."""
