"""The layout with which Foxglove shows a run: the scene, the heights, the errors, the log."""

from __future__ import annotations

from typing import Literal

from foxglove import layouts as fox

from kybflow.core.geometry import ZERO, add, norm, scale
from kybflow.dsl.plan import Plan
from kybflow.recording.viewers.channels import LOG_TOPIC, SCENE_TOPIC
from kybflow.recording.viewers.scene import WORLD_FRAME, colours


def layout(plan: Plan) -> str:
    """Return the layout of a run as JSON."""
    heights, errors = list[fox.PlotSeries](), list[fox.PlotSeries]()
    for name, shade in colours(plan).items():
        heights += (
            _series(f"{name} height", f"/{name}/tick.estimate.position.z", shade, "solid"),
            _series(f"{name} setpoint", f"/{name}/setpoint_pose.pose.position.z", shade, "dashed"),
        )
        error = f"/{name}/position_error"
        errors += (
            _series(f"{name} x", f"{error}.x", shade, "solid"),
            _series(f"{name} y", f"{error}.y", shade, "dashed"),
            _series(f"{name} z", f"{error}.z", shade, "dotted"),
        )
    beside: list[tuple[float, fox.Content]] = [
        (2.0, fox.PlotPanel(title="Height, m", config=fox.PlotConfig(paths=heights))),
        (2.0, fox.PlotPanel(title="Position error, m", config=fox.PlotConfig(paths=errors))),
        (1.0, fox.LogPanel(config=fox.LogConfig(topic_to_render=LOG_TOPIC))),
    ]
    column = [fox.SplitItem(proportion=share, content=panel) for share, panel in beside]
    row = [
        fox.SplitItem(proportion=3.0, content=fox.ThreeDeePanel(config=_scene(plan))),
        fox.SplitItem(proportion=2.0, content=fox.SplitContainer(direction="column", items=column)),
    ]
    return fox.Layout(content=fox.SplitContainer(direction="row", items=row)).to_json()


def _series(
    label: str, value: str, shade: str, style: Literal["solid", "dashed", "dotted"]
) -> fox.PlotSeries:
    return fox.PlotSeries(label=label, value=value, color=shade, line_style=style)


def _scene(plan: Plan) -> fox.ThreeDeeConfig:
    """Return the settings of the panel that shows the scene, from the south and above."""
    drawn = fox.BaseRendererSceneUpdateTopicSettings(visible=True)
    topics: dict[str, fox.BaseRendererTopicSettings] = {SCENE_TOPIC: drawn}
    for name in colours(plan):
        topics[f"/{name}/trail"] = drawn
        topics[f"/{name}/setpoint_pose"] = fox.BaseRendererPoseTopicSettings(
            visible=True, type="axis", axis_scale=0.2
        )
    centre, extent = ZERO, 5.0
    if plan.fence is not None:
        centre = scale(add(*plan.fence), 0.5)
        extent = norm(plan.fence.size)
    return fox.ThreeDeeConfig(
        fixed_frame=WORLD_FRAME, follow_tf=WORLD_FRAME, follow_mode="follow-none", topics=topics,
        camera_state=fox.ThreeDeeCameraState(
            perspective=True, distance=1.2 * extent, phi=60.0, target_offset=centre
        ),
        layers={"grid": fox.BaseRendererGridLayerSettings(visible=True, frame_id=WORLD_FRAME)},
    )  # fmt: skip
