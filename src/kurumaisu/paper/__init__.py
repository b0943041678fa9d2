# SPDX-License-Identifier: BSD-3-Clause
"""The paper's experiments, repeated: figures 3 to 12, equations (1), (2) and (4), and one's own chair identified."""
