"""Video over a network: the headers between coded pictures, and H.264 by PyAV (`codec`), its only
user."""

PYAV = ("av",)
"""The package of PyAV."""
WAY_OUT = "install it: pip install 'kybflow[video]'"
"""For who has none."""
