#!/usr/bin/env bash
# Builds an sdist and of it a wheel, and uses that in an environment that has neither ROS nor MRPT nor the source tree:
# with Debian's Python, and the newest other one that is there. wheel.bash [PYTHON]...: with these.
set -eu
source "$(dirname "$0")/../scripts/environment.bash"
export LC_ALL=C.UTF-8 PIP_DISABLE_PIP_VERSION_CHECK=1 CMAKE_CXX_COMPILER_LAUNCHER=ccache
export CCACHE_BASEDIR=$root CCACHE_NOHASHDIR=1
place=$root/.ws/wheel
mkdir -p "$place"

newest() {   # of those on the path and pyenv's
  local python
  for python in $(compgen -c python3. | sort -u) "${PYENV_ROOT:-$HOME/.pyenv}"/versions/3.*/bin/python; do
    "$python" -c 'import sys; print(*sys.version_info[:2], sys.executable) if sys.version_info > (3, 12) else 0' 2>/dev/null || true
  done | sort -k1,1n -k2,2n | awk 'NF == 3 {python = $3} END {print python}'
}

# environment FOLDER PYTHON [REQUIREMENT]...: an environment that has these, and nothing of the system's
environment() {
  local folder=$1 python=$2 stamp
  shift 2
  stamp="$("$python" -VV) $*"
  [ "$(cat "$folder/stamp" 2>/dev/null)" != "$stamp" ] || return 0
  "$python" -m venv --clear "$folder"
  "$folder/bin/python" -m pip install -q --no-compile "$@"
  printf '%s\n' "$stamp" >"$folder/stamp"
}

# listed KEY: a list of pyproject.toml
listed() {
  /usr/bin/python3 -c '
import sys, tomllib
project = tomllib.load(open(sys.argv[1], "rb"))
lists = {"build": project["build-system"]["requires"], "run": project["project"]["dependencies"]}
print(*lists[sys.argv[2]], *(project["project"]["optional-dependencies"]["gym"] if sys.argv[2] == "run" else []), sep="\n")
' "$root/pyproject.toml" "$1"
}

# build PYTHON NAME: the sdist from what git would commit, and from that the wheel
build() {
  local tools=$place/tools-$2 requires
  mapfile -t requires < <(listed build)
  environment "$tools" "$1" "${requires[@]}" cmake ninja
  rm -rf "$place"/{tree,dist,kurumaisu-*}
  mkdir -p "$place/tree"
  git -C "$root" ls-files -z -co --exclude-standard | (cd "$root" && xargs -0 ls -d 2>/dev/null) |
    tar -C "$root" -cf - -T - | tar -C "$place/tree" -xf -
  (cd "$place/tree" && "$tools/bin/python" -c '
import sys; from scikit_build_core.build import build_sdist; build_sdist(sys.argv[1])' "$place/dist")
  tar -C "$place" -xf "$place"/dist/*.tar.gz
  "$tools/bin/python" -m pip wheel -q --no-build-isolation --no-deps -w "$place/dist" --config-settings="build-dir=$place/build-$2" "$place"/kurumaisu-*/
}

# prove PYTHON NAME: the programs, and tests that need no ROS
prove() {
  local there=$place/env-$2 requires
  mapfile -t requires < <(listed run)
  environment "$there" "$1" "${requires[@]}" pytest hypothesis mpmath shapely
  "$there/bin/python" -m pip install -q --no-deps --no-compile --force-reinstall "$place"/dist/*.whl
  cd "$place"
  rm -rf use && mkdir -p use/tests
  for name in "${tests[@]}"; do cp "$root/tests/$name" use/tests; done
  cd use
  env -i "HOME=$place/use" PATH="$there/bin:/usr/bin:/bin" LANG=C.UTF-8 bash -eu "$root/.ci/wheel_use.bash" "$root/worlds/room.world"
}

tests=(conftest.py test_examples.py test_model.py test_world.py)
[ $# -gt 0 ] || set -- /usr/bin/python3 $(newest)
for python; do
  name=$("$python" -c 'import sys; print("%d.%d" % sys.version_info[:2])')
  build "$python" "$name"
  prove "$python" "$name"
done
[ $# -gt 1 ] || echo "no Python newer than Debian's is here"
