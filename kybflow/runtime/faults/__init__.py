"""Faults: deliberate failures of a simulated vehicle, one per file. A fault only declares its
effects (ADR 11); `kybflow.runtime.fleet.injection` applies them. The catalog finds the faults."""
