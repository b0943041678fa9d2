# SPDX-License-Identifier: BSD-3-Clause
"""stageros: a world of Stage behind the topics, frames and services of stage_ros 1.8.0."""
