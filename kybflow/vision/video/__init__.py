"""Video over a network: frame headers (`pave`), and H.264 by PyAV (`codec`), its only user."""

PYAV = ("av",)
"""PyAV's package."""
WAY_OUT = "install it: pip install 'kybflow[video]'"
"""How to install PyAV."""
