"""The messages and constants of MAVLink. This is the only import of pymavlink: whatever needs it
first, who lacks it is told what to install."""

from kybflow.core.errors import DriverError

try:
    from pymavlink.dialects.v20 import all as mavlink
except ImportError as missing:
    raise DriverError("MAVLink needs pymavlink: pip install 'kybflow[mavlink]'") from missing

__all__ = ["mavlink"]
