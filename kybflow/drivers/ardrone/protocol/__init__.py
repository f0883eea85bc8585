"""The AR.Drone 2.0 protocol: AT commands, navigation data and the configuration file.

It converts bytes to values and back, without sockets, clocks or state. Values are as on the wire,
in the drone's frame (x forward, y right, z down); `telemetry` and `control` convert them. The
sensor `ardrone_camera` receives the video. Sources: AR.Drone Developer Guide (SDK 2.0), and the
headers of Parrot's SDK.
"""
