"""What one autopilot says, as measurements, status, parameters and clock offset; and what it is
told of where it is.
"""
