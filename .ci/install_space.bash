#!/usr/bin/env bash
# Installs into .ws/install and uses what is there from an environment that has never seen the source tree.
set -eu
root=$(cd "$(dirname "$0")/.." && pwd)
rm -rf "$root/.ws/install"
cmake --build "$root/.ws/build" --target install
prefix=$root/.ws/install
links=$(find "$prefix" -type l)
[ -z "$links" ] || { echo "installed as links: $links"; exit 1; }
cd /
exec env -i "HOME=$HOME" PATH=/usr/bin:/bin LANG=C.UTF-8 bash -eu -c '
  prefix=$1 python=$2
  set +u; source "$prefix/setup.bash"; set -u
  # -P: not even the working directory is on the path
  "$python" -P - "$prefix" <<"EOF"
import sys
from pathlib import Path
import kurumaisu, kurumaisu._core, kurumaisu.msg
from kurumaisu import params
prefix = Path(sys.argv[1])
for module in (kurumaisu, kurumaisu._core, kurumaisu.msg):
    assert Path(module.__file__).is_relative_to(prefix), module.__file__
model = params.shipped("launch/md100.yaml")
assert model.is_relative_to(prefix), model
print(model, params.load_model(model).name)
EOF
  [ "$(rospack find kurumaisu)" = "$prefix/share/kurumaisu" ]
  "$python" -P -m pytest -c /dev/null -p no:cacheprovider "$3"
  for program in "$prefix"/lib/kurumaisu/* "$prefix"/lib/lib*.so; do
    [ -f "$program" ] || continue
    # a library that only the source tree has
    if ldd "$program" 2>/dev/null | grep "not found"; then echo "$program: lacks these libraries"; exit 1; fi
    if head -c 2 "$program" | grep -q "#!"; then
      head -n 1 "$program" | grep -qxF "#!$python" || { echo "$program: its interpreter is not the environment"; exit 1; }
      "$python" -P -m py_compile "$program"
    fi
  done
' install-space "$prefix" "$root/.venv/bin/python" "$root/tests/test_shipped.py"
