"""The messages and constants of MAVLink. Only this module imports pymavlink; its error says how to
install it."""

from kybflow.core.errors import DriverError

try:
    from pymavlink.dialects.v20 import all as mavlink
except ImportError as missing:
    raise DriverError("MAVLink needs pymavlink: pip install 'kybflow[mavlink]'") from missing

__all__ = ["mavlink"]
