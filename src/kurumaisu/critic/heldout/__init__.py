# SPDX-License-Identifier: BSD-3-Clause
"""What an extension gains on data that it was not fitted to, and whether an effect matters (materiality.py)."""
