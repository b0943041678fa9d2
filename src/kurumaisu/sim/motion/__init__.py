# SPDX-License-Identifier: BSD-3-Clause
"""How bodies move and what stops them: physical motion, and Stage's."""
