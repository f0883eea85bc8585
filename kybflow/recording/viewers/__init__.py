"""What a viewer draws of a run, in Foxglove's standard messages beside the compact ticks.

`scene` builds the world and the vehicles, `channels` logs what moves, and `panels` arranges
Foxglove's panels. Only this package and `kybflow.recording.recorder`, which uses it, import the
foxglove SDK.
"""
