# SPDX-License-Identifier: BSD-3-Clause
"""Where the scans put the chair: the reference's path, moved by the errors that the scans see in it."""
