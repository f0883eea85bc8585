"""What one autopilot reports, as status, measurements, parameters, clock offset and ground truth;
and the external vision that it is sent.

Nothing is commanded here. `AutopilotState` hands each message to the module that it concerns.
"""
