# SPDX-License-Identifier: BSD-3-Clause
"""How fast a robot was, and was asked to be: by poses, by inputs, and by an inertial sensor mounted somehow."""
