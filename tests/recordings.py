# SPDX-License-Identifier: BSD-3-Clause
"""A made-up drive, and how to write it as a bag, for the tests of the readers."""

import dataclasses
import struct
from decimal import Decimal
from pathlib import Path

import mcap.writer
import numpy as np
from rosbags import rosbag1, rosbag2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from kurumaisu.critic.values.recording import Run, Series

BEAMS = 7
PACKAGE = Path(__file__).resolve().parents[1]


def series(t, columns, *values):
    return Series(np.asarray(t, dtype=float), np.column_stack(values).astype(float), tuple(columns))


def full_run(name="run_1", start=0.0):
    """A drive with every part; stamps have whole microseconds, which a bag can hold."""
    rng = np.random.default_rng(4)
    t = np.round(start + np.arange(1, 101) / 10 + rng.uniform(0, 0.02, 100), 6)
    theta = 0.9 * (t - start)
    ranges = np.round(rng.uniform(0.3, 3.9, (100, BEAMS)), 3)
    ranges[3, 2], ranges[5, 1] = np.nan, np.inf
    return Run(
        name=name,
        command=series(t[::5], "vw", rng.uniform(-0.4, 0.8, 20), rng.uniform(-1, 1, 20)),
        voltage=series(t, ("v_f", "v_s"), rng.normal(size=100), rng.normal(size=100)),
        pose=series(t, ("x", "y", "theta"), rng.normal(size=100), rng.normal(size=100), theta),
        odom=series(t, ("x", "y", "theta", "v", "w"), *rng.normal(size=(2, 100)), theta, *rng.normal(size=(2, 100))),
        scan=series(t, [f"r{i}" for i in range(BEAMS)], ranges),
        covariates={
            "battery": series(t[::10], ["battery"], np.linspace(25.2, 24.9, 10)),
            "temperature": series(t[::20], ["temperature"], np.linspace(20.0, 24.0, 5)),
            "tyre": series(t[::50], ["tyre"], np.array([2.1, 2.2])),
        },
    )


def nanoseconds(t):
    """Return the decimal number that t prints as; t * 1e9 would be off by a hundred nanoseconds."""
    return int(Decimal(repr(float(t))) * 10**9)


class Mcap:
    """The mcap library's writer, called as those of rosbags are."""

    def __init__(self, path, store, ros, compression):
        self.file = path.open("wb")
        self.store, self.ros = store, ros
        packed = mcap.writer.CompressionType[compression or "NONE"]
        self.writer = mcap.writer.Writer(self.file, compression=packed, chunk_size=4096)
        self.writer.start(profile=f"ros{ros}")

    def add_connection(self, topic, kind, typestore):
        text, _ = typestore.generate_msgdef(kind, ros_version=self.ros)
        name = kind.replace("/msg/", "/") if self.ros == 1 else kind
        schema = self.writer.register_schema(name, f"ros{self.ros}msg", text.encode())
        return self.writer.register_channel(topic, "ros1" if self.ros == 1 else "cdr", schema)

    def write(self, channel, received, data):
        self.writer.add_message(channel, received, bytes(data), received)

    def close(self):
        self.writer.finish()
        self.file.close()


class OldBag:
    """Writes bags of format 1.2 by its specification: no library does any more, but that of ROS 1 reads them."""

    def __init__(self, path):
        self.file = path.open("wb")
        self.file.write(b"#ROSBAG V1.2\n")
        self.known = set()

    def add_connection(self, topic, kind, typestore):
        text, md5 = typestore.generate_msgdef(kind)
        named = {"topic": topic.encode(), "type": kind.replace("/msg/", "/").encode(), "md5": md5.encode()}
        return {**named, "def": text.encode()}

    def write(self, fields, received, data):
        if fields["topic"] not in self.known:
            self.record({"op": b"\x01", **fields}, b"")
            self.known.add(fields["topic"])
        named = {name: value for name, value in fields.items() if name != "def"}
        times = {"sec": struct.pack("<I", received // 10**9), "nsec": struct.pack("<I", received % 10**9)}
        self.record({"op": b"\x02", **named, **times}, bytes(data))

    def record(self, fields, data):
        whole = [name.encode() + b"=" + value for name, value in fields.items()]
        head = b"".join(struct.pack("<I", len(field)) + field for field in whole)
        self.file.write(struct.pack("<I", len(head)) + head + struct.pack("<I", len(data)) + data)

    def close(self):
        self.file.close()


class Bag:
    """Writes messages with the serialisers and writers of rosbags and mcap.

    ros: 1 or 2, of the messages. path: .bag, .mcap, or for a folder of ROS 2 any other, with the storage of that name.
    old: in format 1.2.
    """

    def __init__(self, path, compression=None, ros=1, storage="SQLITE3", old=False):
        self.ros = ros
        self.store = get_typestore(Stores.ROS1_NOETIC if ros == 1 else Stores.ROS2_JAZZY)
        text = (PACKAGE / "msg" / "Voltages.msg").read_text(encoding="utf-8")
        self.store.register(get_types_from_msg(text, "kurumaisu/msg/Voltages"))
        if ros == 1:
            text = "geometry_msgs/TransformStamped[] transforms"
            self.store.register(get_types_from_msg(text, "tf2_msgs/msg/TFMessage"))
        self.connections = {}
        if path.suffix == ".mcap":
            self.writer = Mcap(path, self.store, ros, compression)
            return
        if old:
            self.writer = OldBag(path)
            return
        if ros == 1:
            self.writer = rosbag1.Writer(path)
            if compression:
                self.writer.set_compression(compression)
        else:
            plugin = rosbag2.StoragePlugin[storage]
            self.writer = rosbag2.Writer(path, version=9, storage_plugin=plugin)
            if compression:
                self.writer.set_compression(compression, rosbag2.CompressionFormat.ZSTD)
        self.writer.open()

    def make(self, kind, **values):
        return self.store.types[kind](**values)

    def header(self, t):
        ns = nanoseconds(t)
        stamp = self.make("builtin_interfaces/msg/Time", sec=ns // 10**9, nanosec=ns % 10**9)
        counted = {"seq": 0} if self.ros == 1 else {}
        return self.make("std_msgs/msg/Header", **counted, stamp=stamp, frame_id="map")

    def write(self, topic, message, received):
        kind = message.__msgtype__
        if topic not in self.connections:
            self.connections[topic] = self.writer.add_connection(topic, kind, typestore=self.store)
        data = (self.store.serialize_ros1 if self.ros == 1 else self.store.serialize_cdr)(message, kind)
        self.writer.write(self.connections[topic], nanoseconds(received), data)

    def vector(self, x=0.0, y=0.0, z=0.0, kind="Vector3"):
        return self.make(f"geometry_msgs/msg/{kind}", x=x, y=y, z=z)

    def twist(self, v, w):
        return self.make("geometry_msgs/msg/Twist", linear=self.vector(x=v), angular=self.vector(z=w))

    def pose(self, x, y, theta):
        turn = self.make("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=np.sin(theta / 2), w=np.cos(theta / 2))
        return self.make("geometry_msgs/msg/Pose", position=self.vector(x, y, kind="Point"), orientation=turn)

    def pose_stamped(self, t, pose):
        return self.make("geometry_msgs/msg/PoseStamped", header=self.header(t), pose=self.pose(*pose))

    def pose_with_covariance(self, t, pose):
        posed = self.make("geometry_msgs/msg/PoseWithCovariance", pose=self.pose(*pose), covariance=np.zeros(36))
        return self.make("geometry_msgs/msg/PoseWithCovarianceStamped", header=self.header(t), pose=posed)

    def transform(self, t, parent, child, pose):
        posed = self.pose(*pose)
        moved = self.vector(posed.position.x, posed.position.y)
        return self.make(
            "geometry_msgs/msg/TransformStamped",
            header=dataclasses.replace(self.header(t), frame_id=parent),
            child_frame_id=child,
            transform=self.make("geometry_msgs/msg/Transform", translation=moved, rotation=posed.orientation),
        )

    def transforms(self, *transforms):
        return self.make("tf2_msgs/msg/TFMessage", transforms=list(transforms))

    def point_stamped(self, t, x, y):
        return self.make("geometry_msgs/msg/PointStamped", header=self.header(t), point=self.vector(x, y, kind="Point"))

    def fix(self, t, latitude, longitude):
        return self.make(
            "sensor_msgs/msg/NavSatFix",
            header=self.header(t),
            status=self.make("sensor_msgs/msg/NavSatStatus", status=0, service=1),
            latitude=latitude,
            longitude=longitude,
            altitude=300.0,
            position_covariance=np.zeros(9),
            position_covariance_type=0,
        )

    def joints(self, t, names, angles, rates):
        values = {"position": np.array(angles), "velocity": np.array(rates), "effort": np.zeros(0)}
        return self.make("sensor_msgs/msg/JointState", header=self.header(t), name=names, **values)

    def odometry(self, t, pose, v, w):
        none = np.zeros(36)
        return self.make(
            "nav_msgs/msg/Odometry",
            header=self.header(t),
            child_frame_id="base_link",
            pose=self.make("geometry_msgs/msg/PoseWithCovariance", pose=self.pose(*pose), covariance=none),
            twist=self.make("geometry_msgs/msg/TwistWithCovariance", twist=self.twist(v, w), covariance=none),
        )

    def imu(self, t, values):
        """values: rates, and accelerations if there are any."""
        rates, felt = values[:3], values[3:]
        return self.make(
            "sensor_msgs/msg/Imu",
            header=self.header(t),
            orientation=self.make("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=0.0, w=1.0),
            orientation_covariance=np.full(9, -1.0),
            angular_velocity=self.vector(*rates),
            angular_velocity_covariance=np.zeros(9),
            linear_acceleration=self.vector(*felt),
            linear_acceleration_covariance=np.full(9, 0.0 if len(felt) else -1.0),
        )

    def scan(self, t, ranges):
        fan = {"angle_min": -2.0, "angle_max": -1.4, "angle_increment": 0.1, "scan_time": 0.1}
        return self.make(
            "sensor_msgs/msg/LaserScan",
            header=self.header(t),
            **fan,
            time_increment=0.0,
            range_min=0.06,
            range_max=4.0,
            ranges=ranges.astype(np.float32),
            intensities=np.zeros(0, dtype=np.float32),
        )

    def voltages(self, t, v_f, v_s):
        values = {"translation": v_f, "steering": v_s, "reference": 2.5, "v": 0.0, "w": 0.0}
        return self.make("kurumaisu/msg/Voltages", header=self.header(t), **values)

    def twist_stamped(self, t, v, w):
        return self.make("geometry_msgs/msg/TwistStamped", header=self.header(t), twist=self.twist(v, w))

    def temperature(self, t, celsius):
        kind = "sensor_msgs/msg/Temperature"
        return self.make(kind, header=self.header(t), temperature=celsius, variance=0.0)

    def battery(self, t, volts):
        unmeasured = {
            name: float("nan")
            for name in ("temperature", "current", "charge", "capacity", "design_capacity", "percentage")
        }
        return self.make(
            "sensor_msgs/msg/BatteryState",
            header=self.header(t),
            voltage=volts,
            **unmeasured,
            power_supply_status=0,
            power_supply_health=0,
            power_supply_technology=0,
            present=False,
            cell_voltage=np.zeros(0, dtype=np.float32),
            cell_temperature=np.zeros(0, dtype=np.float32),
            location="",
            serial_number="",
        )


def write_bag(path, run, *, compression=None, stamped=True, late=0.0, slash="/", **how):
    """Write a full run; late: how long after the stamp a message is received [s]; slash: what topics begin with."""
    bag = Bag(path, compression, **how)
    to_message = {
        "/voltages": (run.voltage, lambda t, row: bag.voltages(t, *row)),
        "/mocap/pose": (run.pose, bag.pose_stamped),
        "/odom": (run.odom, lambda t, row: bag.odometry(t, row[:3], *row[3:])),
        "/scan": (run.scan, bag.scan),
        "/battery": (run.covariates["battery"], lambda t, row: bag.battery(t, *row)),
        "/temperature": (run.covariates["temperature"], lambda t, row: bag.temperature(t, *row)),
    }
    if stamped:
        to_message["/cmd_vel"] = run.command, lambda t, row: bag.twist_stamped(t, *row)
    messages = [
        (t + late, topic, convert(t, row))
        for topic, (part, convert) in to_message.items()
        for t, row in zip(part.t, part.values, strict=True)
    ]
    if not stamped:
        rows = zip(run.command.t, run.command.values, strict=True)
        messages += [(t, "/cmd_vel", bag.twist(*row)) for t, row in rows]
    tyre = run.covariates["tyre"]
    for t, (bar,) in zip(tyre.t, tyre.values, strict=True):
        messages.append((t, "/tyre_pressure", bag.make("std_msgs/msg/Float64", data=bar)))
    for received, topic, message in sorted(messages, key=lambda item: item[0]):
        bag.write(slash + topic[1:], message, received)
    bag.writer.close()


def assert_same(a, b, atol):
    """Compare every array of two runs; battery is float32 in a bag."""
    for part in ("command", "voltage", "pose", "odom", "scan"):
        one, other = getattr(a, part), getattr(b, part)
        assert one.columns == other.columns, part
        np.testing.assert_array_equal(one.t, other.t, err_msg=part)
        np.testing.assert_allclose(one.values, other.values, rtol=0, atol=atol, err_msg=part)
    assert set(a.covariates) == set(b.covariates)
    for name, one in a.covariates.items():
        np.testing.assert_array_equal(one.t, b.covariates[name].t, err_msg=name)
        np.testing.assert_allclose(one.values, b.covariates[name].values, rtol=1e-6, err_msg=name)
