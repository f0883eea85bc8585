"""Faults: what breaks a simulated vehicle on purpose, one a file. Each says its effects and does
nothing itself (ADR 11); `kybflow.runtime.fleet.injection` brings them about. The catalog finds
them."""
