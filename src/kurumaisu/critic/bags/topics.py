# SPDX-License-Identifier: BSD-3-Clause
"""Read topics of a bag: only those that are wanted, message by message."""

from __future__ import annotations

from array import array
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.interfaces import Connection, ConnectionExtRosbag1, ConnectionExtRosbag2, MessageDefinitionFormat
from rosbags.interfaces.typing import Typesdict
from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore

from kurumaisu.critic.bags.containers import broken, opened
from kurumaisu.critic.bags.messages import ScanRow, shown
from kurumaisu.critic.bags.parts import parts_of
from kurumaisu.errors import Error, told
from kurumaisu.types import BoolArray, FloatArray, IntArray

Row = tuple[float, ...] | dict[str, float] | ScanRow
Convert = Callable[[Any], Row | None]  # None: a message that says nothing of what is wanted
_BEGINNING = 1e9  # [ns] within which a message was received of those that a clock stamped when it began
Wanted = Mapping[str, Callable[[str], Convert]]
_HEADER = "std_msgs/msg/Header"
_RULE = "=" * 80 + "\n"  # between the definitions of IDL


@dataclass
class Topic:
    """Messages of one topic: times [ns], the stamp 0 where there is none, and what each says.

    columns: of numbers, known where the messages name them; scans: what is no row of numbers.
    """

    name: str
    type: str
    received: array[int] = field(default_factory=lambda: array("q"))
    stamps: array[int] = field(default_factory=lambda: array("q"))
    numbers: array[float] = field(default_factory=lambda: array("d"))
    columns: tuple[str, ...] = ()
    scans: list[ScanRow] = field(default_factory=list)

    def add(self, received: int, stamp: int, row: Row) -> None:
        """Append a message."""
        self.received.append(received)
        self.stamps.append(stamp)
        if isinstance(row, ScanRow):
            self.scans.append(row)
        elif isinstance(row, dict):
            self.columns = self.columns or tuple(row)
            self.numbers.extend(row.values())
        else:
            self.numbers.extend(row)

    def order(self) -> IntArray:
        """Return the indices of messages in the order of receipt, (n,): some files have another."""
        return np.argsort(np.asarray(self.received), kind="stable")

    def rows(self) -> FloatArray:
        """Return the numbers in the order of receipt, (n, m)."""
        return np.asarray(self.numbers, dtype=np.float64).reshape(len(self.received), -1)[self.order()]

    def times(self) -> FloatArray:
        """Return the stamp of each message, or else when it was received, in the order of receipt, (n,) [s]."""
        stamps, received = np.asarray(self.stamps), np.asarray(self.received)
        # Integers divide to the float nearest to the decimal number of seconds, the one CSV reads.
        times = [int(ns) / 1_000_000_000 for ns in np.where(self._stamped(), stamps, received)[self.order()]]
        return np.array(times, dtype=np.float64)

    def _stamped(self) -> BoolArray:
        """Return which messages have a stamp, (n,). One of 0 is none, unless a simulation's clock begins there."""
        stamps, received = np.asarray(self.stamps), np.asarray(self.received)
        late = self.lateness()
        begins = False if late is None else np.abs(received - 1e9 * late) < _BEGINNING
        return np.asarray((stamps != 0) | begins, dtype=np.bool_)

    def lateness(self) -> float | None:
        """Return the median of receipt minus stamp [s], None when nothing is stamped."""
        stamps, received = np.asarray(self.stamps), np.asarray(self.received)
        late = (received - stamps)[stamps != 0]
        return float(np.median(late)) / 1e9 if len(late) else None


def read_topics(path: Path, wanted: Wanted) -> dict[str, Topic]:
    """Read the topics that are in the bag, or in all parts of one that was split, by absolute topic.

    wanted: by topic, what makes of a message's type a function from a message to its row; raises Error for a type
    that does not serve. Raise Error naming file, topic and type for what cannot be read.
    """
    found: dict[str, Topic] = {}
    converters: dict[tuple[str, str], Convert] = {}
    for bag, connection, received, message in read_messages(path, wanted):
        name, kind = absolute(connection.topic), connection.msgtype
        where = f"{bag}: {connection.topic}"
        if (name, kind) not in converters:
            try:
                converters[name, kind] = wanted[name](kind)
            except Error as error:
                raise Error(f"{where}: {error}") from error
        topic = found.setdefault(name, Topic(connection.topic, shown(kind)))
        try:
            row = converters[name, kind](message)
            if row is not None:
                topic.add(received, stamp_of(message), row)
        except AttributeError as error:
            raise Error(f"{where}: {shown(kind)} has another definition here: {error}") from error
        except Error as error:
            raise Error(f"{where}: {error}") from error
    return {name: topic for name, topic in found.items() if topic.received}


def read_messages(path: Path, topics: Collection[str]) -> Iterator[tuple[Path, Connection, int, Any]]:
    """Yield file, connection, time of receipt [ns] and message, of all parts of a bag. topics: absolute names.

    Raise Error naming file and topic for what cannot be read.
    """
    for bag in parts_of(path):
        with opened(bag) as opened_bag:
            chosen = [connection for connection in opened_bag.connections if absolute(connection.topic) in topics]
            decoders: dict[Any, Callable[[bytes], Any]] = {}
            for connection, received, data in opened_bag.messages(chosen) if chosen else ():
                key = connection.msgtype, connection.msgdef
                if key not in decoders:
                    decoders[key] = decoder(bag, connection)
                yield bag, connection, received, _decoded(bag, connection, decoders[key], data)


def absolute(topic: str) -> str:
    """Return a topic's absolute name: rosbag records a relative one as it was typed."""
    return f"/{topic.strip('/')}"


def _decoded(path: Path, connection: Connection, decode: Callable[[bytes], Any], data: bytes) -> Any:
    try:
        return decode(data)
    except Exception as error:  # of the decoder that was made from the bag's own definition
        told = str(error) or type(error).__name__
        raise Error(f"{broken(path)}: {connection.topic}: a message cannot be read: {told}") from error


def stamp_of(message: Any) -> int:
    """Return the stamp of a message [ns], 0 where it has none."""
    header = getattr(message, "header", None)
    return 0 if header is None else int(header.stamp.sec) * 1_000_000_000 + int(header.stamp.nanosec)


def decoder(path: Path, connection: Connection) -> Callable[[bytes], Any]:
    """Return a function from a message's bytes to the message.

    Bags of ROS 2 before Iron carry no definitions; their types are those of Humble.
    Raise Error naming file, topic and type of which nothing is known.
    """
    kind = connection.msgtype
    ros1 = isinstance(connection.ext, ConnectionExtRosbag1)
    if isinstance(connection.ext, ConnectionExtRosbag2) and connection.ext.serialization_format != "cdr":
        encoding = told(connection.ext.serialization_format)
        raise Error(f"{path}: {connection.topic}: its messages are encoded as {encoding}, not as those of ROS")
    store = get_typestore(Stores.EMPTY)
    if connection.msgdef.format == MessageDefinitionFormat.NONE:
        store = get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_HUMBLE)
        if kind not in store.fielddefs:
            raise Error(f"{path}: {connection.topic}: the bag has no definition of its type {shown(kind)}")
    elif connection.msgdef.format == MessageDefinitionFormat.IDL:
        store.register(_idl(connection.msgdef.data))
    else:
        # Bags of 2010 call the header roslib/Header, so its definition is not found among theirs.
        known = {_HEADER: get_typestore(Stores.ROS1_NOETIC).fielddefs[_HEADER]} if ros1 else {}
        store.register({**known, **get_types_from_msg(connection.msgdef.data, kind)})
    decode = store.deserialize_ros1 if ros1 else store.deserialize_cdr
    return lambda data: decode(data, kind)


def _idl(text: str) -> Typesdict:
    parts = text.split(_RULE)[1:] if text.startswith(f"{_RULE}IDL: ") else [f"\n{text}"]
    found: Typesdict = {}
    for part in parts:
        found.update(get_types_from_idl(part.partition("\n")[2]))
    return found
