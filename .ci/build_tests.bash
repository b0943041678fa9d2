#!/usr/bin/env bash
# Builds the test programs, on all cores as scripts/setup built the rest: make alone takes one.
set -eu
source "$(dirname "$0")/../scripts/environment.bash"
export LC_ALL=C.UTF-8   # as scripts/setup has it: ccache knows results by language, too
exec cmake --build "$root/.ws/build" --target tests -- "-j$(jobs)"
