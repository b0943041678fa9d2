# SPDX-License-Identifier: BSD-3-Clause
"""The only Python that knows ROS: nodes and commands in folders by subject, and here what they share."""
