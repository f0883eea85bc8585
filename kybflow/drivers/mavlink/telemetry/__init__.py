"""The reports of one autopilot: status, measurements, parameters, clock offset and ground truth;
and the external vision sent to it.

Nothing is commanded here. `AutopilotState` passes each message to the module responsible for it.
"""
