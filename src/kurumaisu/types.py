# SPDX-License-Identifier: BSD-3-Clause
"""Array types shared by all modules."""

from typing import Any

import numpy as np

# What numpy.typing.NDArray stands for, which takes long to load.
FloatArray = np.ndarray[Any, np.dtype[np.float64]]
IntArray = np.ndarray[Any, np.dtype[np.int64]]
BoolArray = np.ndarray[Any, np.dtype[np.bool_]]
ByteArray = np.ndarray[Any, np.dtype[np.uint8]]
