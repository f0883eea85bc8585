"""kybflow: experiments with quadrotors, written in YAML, proven before take-off, flown."""

__version__ = "0.1.0"
