# SPDX-License-Identifier: BSD-3-Clause
"""From the bytes of a message to its fields, by the definition that the bag carries."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from rosbags.interfaces import Connection, ConnectionExtRosbag1, ConnectionExtRosbag2, MessageDefinitionFormat
from rosbags.interfaces.typing import Typesdict
from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore

from kurumaisu.errors import Error, told

_HEADER = "std_msgs/msg/Header"
_RULE = "=" * 80 + "\n"  # between the definitions of IDL


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


def shown(kind: str) -> str:
    """Return a type as ROS 1 writes it."""
    return kind.replace("/msg/", "/")


def _idl(text: str) -> Typesdict:
    parts = text.split(_RULE)[1:] if text.startswith(f"{_RULE}IDL: ") else [f"\n{text}"]
    found: Typesdict = {}
    for part in parts:
        found.update(get_types_from_idl(part.partition("\n")[2]))
    return found
