# SPDX-License-Identifier: BSD-3-Clause
"""How reference and motion err at random, estimated on every recording: base_noise.py has the noise of the poses."""
