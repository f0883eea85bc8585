"""Drawing of the tag floor, detection of tags in images, and localization from them. Only this
package and `kybflow.sensors` use OpenCV; nothing here is imported before a mission needs a
camera."""

WAY_OUT = "install it: pip install 'kybflow[vision]'"
"""How to install OpenCV."""
OPENCV = (
    "opencv-contrib-python-headless",
    "opencv-contrib-python",
    "opencv-python-headless",
    "opencv-python",
)
"""The packages that contain OpenCV."""
