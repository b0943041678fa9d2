# SPDX-License-Identifier: BSD-3-Clause
"""The version of the package."""

from __future__ import annotations

from xml.etree import ElementTree

from kurumaisu.params import shipped


def version() -> str:
    """Return the package's version."""
    return str(ElementTree.parse(shipped("package.xml")).findtext("version"))
