"""What the studies of `bench/` draw and how they judge it: broken missions, random faults, hostile
inputs. Tests hold them. They need `tests/support`."""
