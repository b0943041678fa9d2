# SPDX-License-Identifier: BSD-3-Clause
"""A virtual URG at a pty or a TCP port, for any client."""

from kurumaisu.virtual_urg.models import Sensor, load_sensor
from kurumaisu.virtual_urg.urg import Pty, Tcp, VirtualUrg

__all__ = ["Pty", "Sensor", "Tcp", "VirtualUrg", "load_sensor"]
