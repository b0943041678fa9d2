# SPDX-License-Identifier: BSD-3-Clause
"""For all tests."""

import hypothesis

# How long an example takes is the machine's business: a busy one is no failure.
hypothesis.settings.register_profile("any machine", deadline=None)
hypothesis.settings.load_profile("any machine")
