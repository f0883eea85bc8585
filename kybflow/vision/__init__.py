"""Images: drawing the tag floor, finding tags, and where the camera is from them. The only user of
OpenCV, with `kybflow.sensors`; nothing here is imported before a mission needs a camera."""

WAY_OUT = "install it: pip install 'kybflow[vision]'"
"""For who has no OpenCV."""
OPENCV = (
    "opencv-contrib-python-headless",
    "opencv-contrib-python",
    "opencv-python-headless",
    "opencv-python",
)
"""The packages that it comes in."""
