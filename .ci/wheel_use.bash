# What somebody does who has installed the wheel; wheel.bash runs it there. wheel_use.bash WORLD
expect() {   # CODE WORDS COMMAND...: the exit code, and what must be said
  local code=$1 words=$2 said status=0
  shift 2
  said=$("$@" 2>&1) || status=$?
  [ "$status" = "$code" ] && grep -qF -- "$words" <<<"$said" && return
  printf '%s: exit code %s, not %s, or it does not say: %s\n%s\n' "$*" "$status" "$code" "$words" "$said"
  exit 1
}

python - <<'END'
import importlib.util, pathlib, sys
import kurumaisu, kurumaisu._core, kurumaisu.sim, kurumaisu.critic
from kurumaisu.params import shipped
prefix = pathlib.Path(sys.prefix)
for path in (kurumaisu.__file__, kurumaisu._core.__file__, shipped("launch/md100.yaml")):
    assert pathlib.Path(path).is_relative_to(prefix), path
found = [name for name in ("rospy", "rosbag", "kurumaisu._slam", "kurumaisu.ros") if importlib.util.find_spec(name)]
assert not found, found
print(sys.version, kurumaisu.__file__)
END
version=$(sed -n 's/.*<version>\(.*\)<.*/\1/p' "$(dirname "$1")/../package.xml")
expect 0 "check-world" kurumaisu --help
expect 0 "kurumaisu $version" kurumaisu --version
expect 0 "no surprises" kurumaisu check-world "$1"
printf 'effects: [{id: base.gain_v, parameters: {gain: 0.08}}]\n' >hidden.yaml
printf 't,v,w\n0,0.3,0\n4,0,0.5\n8,-0.3,0\n12,0,-0.5\n16,0.3,0\n20,0,0\n' >commands.csv
expect 0 "touched something 0 times" kurumaisu sim --commands commands.csv --effects hidden.yaml
expect 3 "base.gain_v: gain 0.0" kurumaisu critic driven -q --only 'base.gain_*'
grep -qF "SLAM needs MRPT" criticism/report.html
expect 0 "pose" kurumaisu critic look driven
touch log.rawlog
expect 1 "SLAM needs MRPT" kurumaisu critic log.rawlog
expect 1 "watch needs ROS" kurumaisu critic watch
python -m pytest -q -c /dev/null -p no:cacheprovider tests
