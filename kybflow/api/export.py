"""Writes a run's signals for other programs: CSV, NumPy, Parquet and rosbag2.

Every file of a format that holds tables is one topic: `NAME.csv` has a vehicle's ticks,
`NAME.imu.csv` its accelerometer and gyroscope, and so on. Columns are single numbers whose names
end with the unit. A bag has `/NAME/odom` (nav_msgs/Odometry: pose of the vehicle in the frame
`world`, velocity in its body) and `/NAME/setpoint` (geometry_msgs/PoseStamped), with stamps of the
run's time.
"""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kybflow.api.runs import RecordedVehicle, Run, imported
from kybflow.core.errors import KybflowError
from kybflow.core.geometry import from_heading, rotate_back

Columns = Mapping[str, NDArray[Any]]


class ExportFailed(KybflowError):
    """A run can't be exported; the message says why."""


def export(run: Run, format: str, out: Path) -> list[Path]:
    """Write a run into the new folder `out`, or for `rosbag2` as the bag `out`. Return the files.
    Raises ExportFailed, LibraryMissing."""
    try:
        if format == "rosbag2":
            return [_write_bag(run, out)]
        out.mkdir(parents=True)
        return [*_write_tables(run, format, out)]
    except FileExistsError:
        raise ExportFailed(f"`{out}` exists; name a new one by --out") from None
    except OSError as error:
        raise ExportFailed(f"`{out}` can't be written: {error.strerror}") from error


def _write_tables(run: Run, format: str, out: Path) -> Iterator[Path]:
    write = WRITERS[format]
    for vehicle in run.each():
        tables: dict[str, Columns] = {vehicle.name: vehicle.columns()}
        for sensor in vehicle.sensors:
            tables[f"{vehicle.name}.{sensor.replace('/', '.')}"] = vehicle.sensor(sensor).columns()
        for stem, columns in tables.items():
            path = out / f"{stem}.{format}"
            write(path, columns)
            yield path


def _write_csv(path: Path, columns: Columns) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(columns)
        writer.writerows(zip(*(values.tolist() for values in columns.values()), strict=True))


def _write_npz(path: Path, columns: Columns) -> None:
    texts = {k: v.astype(str) if v.dtype == object else v for k, v in columns.items()}
    np.savez_compressed(path, allow_pickle=False, **texts)


def _write_parquet(path: Path, columns: Columns) -> None:
    imported("Parquet", "polars").DataFrame(dict(columns)).write_parquet(path)


WRITERS: dict[str, Callable[[Path, Columns], None]] = {
    "csv": _write_csv, "npz": _write_npz, "parquet": _write_parquet,
}  # fmt: skip


def _write_bag(run: Run, out: Path) -> Path:
    rosbag2, stores = imported("rosbag2", "rosbags.rosbag2"), imported("rosbag2", "rosbags.typesys")
    if out.exists():
        raise FileExistsError
    store = stores.get_typestore(stores.Stores.ROS2_HUMBLE)
    with rosbag2.Writer(out, version=9) as writer:
        for vehicle in run.each():
            for topic, kind, messages in (
                ("odom", "nav_msgs/msg/Odometry", _odometry(vehicle, store.types)),
                ("setpoint", "geometry_msgs/msg/PoseStamped", _setpoints(vehicle, store.types)),
            ):
                connection = writer.add_connection(
                    f"/{vehicle.name}/{topic}", kind, typestore=store
                )
                for time, message in messages:
                    writer.write(connection, time, store.serialize_cdr(message, kind))
    return out


def _odometry(vehicle: RecordedVehicle, types: Any) -> Iterator[tuple[int, Any]]:
    """Yield the estimates as (time in ns, Odometry)."""
    rows = (vehicle.position, vehicle.attitude, vehicle.velocity,
            vehicle["estimate.angular_velocity"])  # fmt: skip
    unknown = np.zeros(36)
    make = types.__getitem__
    for time, *row in zip(vehicle.time, *(values.tolist() for values in rows), strict=True):
        position, attitude, velocity, rates = row
        if position[0] != position[0]:
            continue  # no estimate
        pose = _pose(types, position, attitude)
        twist = make("geometry_msgs/msg/Twist")(
            _vector(types, rotate_back(attitude, velocity)), _vector(types, rates)
        )
        yield _ns(time), make("nav_msgs/msg/Odometry")(
            _header(types, time), vehicle.name,
            make("geometry_msgs/msg/PoseWithCovariance")(pose, unknown),
            make("geometry_msgs/msg/TwistWithCovariance")(twist, unknown),
        )  # fmt: skip


def _setpoints(vehicle: RecordedVehicle, types: Any) -> Iterator[tuple[int, Any]]:
    """Yield the setpoints that have a position as (time in ns, PoseStamped)."""
    headings = np.nan_to_num(vehicle["setpoint.heading"]).tolist()
    for time, position, heading in zip(
        vehicle.time, vehicle.setpoint.tolist(), headings, strict=True
    ):
        if position[0] == position[0]:
            pose = _pose(types, position, from_heading(heading))
            stamped = types["geometry_msgs/msg/PoseStamped"](_header(types, time), pose)
            yield _ns(time), stamped


def _ns(time: float) -> int:
    return round(time * 1e9)


def _header(types: Any, time: float) -> Any:
    seconds, rest = divmod(_ns(time), 10**9)
    return types["std_msgs/msg/Header"](
        types["builtin_interfaces/msg/Time"](seconds, rest), "world"
    )


def _vector(types: Any, vector: Any) -> Any:
    return types["geometry_msgs/msg/Vector3"](*vector)


def _pose(types: Any, position: Any, attitude: Any) -> Any:
    w, x, y, z = attitude
    return types["geometry_msgs/msg/Pose"](
        types["geometry_msgs/msg/Point"](*position),
        types["geometry_msgs/msg/Quaternion"](x, y, z, w),
    )
