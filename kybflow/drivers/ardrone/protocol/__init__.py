"""What an AR.Drone 2.0 and its clients send each other: bytes to values and back.

AT commands, navigation data, and the configuration file; the video is a sensor's
(`kybflow.sensors.ardrone_camera`). Nothing here has a socket, a clock or a state. Angles, speeds
and heights are as on the wire, in the drone's own frame (x forward, y right, z down), where a name
says so; `kybflow.drivers.ardrone.telemetry` and `control` convert. Source: AR.Drone Developer Guide
(SDK 2.0), and the headers of Parrot's SDK.
"""
