#!/usr/bin/env bash
# Builds with catkin-tools, devel and install space, in a workspace of its own: as usual as catkin_make. It proves the
# packaging, so it compiles as scripts/setup does: folders lie as in .ws, and ccache has nearly all of it.
set -eu
source "$(dirname "$0")/../scripts/environment.bash"   # without it, .ws would be extended
export LC_ALL=C.UTF-8   # as scripts/setup has it: ccache knows results by language, too
workspace=$root/.ws-tools   # as deep as .ws: ccache compares paths that are relative
rm -rf "$workspace"
trap 'rm -rf "$workspace"' EXIT
mkdir -p "$workspace/src"
cp -a "$root/.ws/src/kurumaisu" "$workspace/src/kurumaisu"   # links into the tree
mapfile -t arguments < <(grep -o -- '-D.*' "$root/.ws/stamp" | sed 's/ -D/\n-D/g')
arguments=("${arguments[@]//"$root/.ws/"/"$workspace/"}")
catkin config --workspace "$workspace" --init --no-extend --install --merge-devel \
  --cmake-args "${arguments[@]}" -DCATKIN_ENABLE_TESTING=OFF
catkin build --workspace "$workspace" --no-status --no-notify --force-cmake --jobs "$(jobs)"
for space in devel install; do
  (set +u; source "$workspace/$space/setup.bash"; rospack find kurumaisu; "$root/.venv/bin/python" -c 'import kurumaisu._core')
done
ccache --show-stats
