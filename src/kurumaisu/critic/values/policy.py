# SPDX-License-Identifier: BSD-3-Clause
"""Numbers that decide in several rooms: from which probability what is said, and how far equations are believed."""

from __future__ import annotations

NAMED = 0.9  # posterior from which a cause is named
RIVAL = 0.05  # posterior from which an effect counts as a rival of another
# The same from which it is a member of a set, which has to hold the truth in 95 cases of 100: of several that each may
# be left out, one acts more often than one of them by itself.
MEMBER = 0.02
FORM_ERROR = 0.15  # share of its signal by which a chair's fault may differ from the catalogue's equation for it
FORM_WAYS = 4  # in which a form may differ, of which one passes for another size, or another effect's
