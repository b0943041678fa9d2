# SPDX-License-Identifier: BSD-3-Clause
"""How reference and motion err at random, estimated on every recording: the noise of the poses is in base_noise.py."""
