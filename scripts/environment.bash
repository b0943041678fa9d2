# Sourced by the other scripts. Forgets what pyenv, conda or another workspace put into the environment: each of these
# variables can make a build or a start fail far from its cause.
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
unset PYTHONPATH PYTHONHOME PYTHONSTARTUP VIRTUAL_ENV CONDA_PREFIX CONDA_DEFAULT_ENV
unset CMAKE_PREFIX_PATH ROS_PACKAGE_PATH LD_LIBRARY_PATH LIBRARY_PATH CPATH PKG_CONFIG_PATH
unset CC CXX CFLAGS CXXFLAGS CPPFLAGS LDFLAGS PIP_USER PIP_TARGET PIP_PREFIX PIP_REQUIRE_VIRTUALENV

jobs() {   # how many compilers at once: one per core, but a unit that includes MRPT takes more than 1 GB
  local cores room
  cores=$(nproc)
  room=$(awk '/^MemAvailable/ {print int($2 / 1.5e6)}' /proc/meminfo 2>/dev/null || true)
  [ "${room:-1}" -lt "$cores" ] || room=$cores
  printf '%d' $((room > 1 ? room : 1))
}
