# SPDX-License-Identifier: BSD-3-Clause
"""Programs around the critic: command line, many recordings, arrays, and the watch on a running robot."""
