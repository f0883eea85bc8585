"""What the commands of `kybflow emulate` share, and those beside `autopilot`."""
