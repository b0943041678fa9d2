#!/usr/bin/env bash
# Builds with catkin-tools, devel and install space, in a workspace of its own: as usual as catkin_make.
# Each source alone, unlike scripts/setup's build: so it must include all that it needs.
# Debug: takes half the time, and sees what only an unoptimised build sees (assertions, missing definitions). No -g:
# nobody looks for symbols here, and to write them is an eighth of the time.
set -eu
source "$(dirname "$0")/../scripts/environment.bash"   # without it, .ws would be extended
workspace=$root/.ws/tools
rm -rf "$workspace"
mkdir -p "$workspace/src"
ln -s "$root/.ws/src/kurumaisu" "$workspace/src/kurumaisu"
catkin config --workspace "$workspace" --init --no-extend --install \
  --cmake-args "-DPYTHON_EXECUTABLE=$root/.venv/bin/python" -DCMAKE_BUILD_TYPE=Debug -DCMAKE_CXX_FLAGS_DEBUG=-O0 \
  -DCATKIN_ENABLE_TESTING=OFF
catkin build --workspace "$workspace" --no-status --no-notify --force-cmake --jobs "$(jobs)"
for space in devel install; do
  (set +u; source "$workspace/$space/setup.bash"; rospack find kurumaisu; "$root/.venv/bin/python" -c 'import kurumaisu._core')
done
