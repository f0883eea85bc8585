"""Video over a network: frame headers (`pave`), and H.264 coding with PyAV (`codec`). Only `codec`
uses PyAV."""

PYAV = ("av",)
"""PyAV's package."""
WAY_OUT = "install it: pip install 'kybflow[video]'"
"""How to install PyAV."""
