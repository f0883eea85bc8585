"""How an emulated autopilot flies: modes, setpoints, position control, arming, failsafe."""
