# The wheel, docs/without_ros.md: kurumaisu._core and the files that programs read. The rest of the package is Python.
set(PYBIND11_FINDPYTHON ON)
find_package(Python REQUIRED COMPONENTS Interpreter Development.Module)
find_package(pybind11 REQUIRED)
find_package(Eigen3 REQUIRED NO_MODULE PATH_SUFFIXES cmeel.prefix/share/eigen3/cmake)  # where PyPI's cmeel-eigen has it
find_package(Threads REQUIRED)

# Into the module itself, which then needs no library that the wheel lacks.
set(BUILD_SHARED_LIBS OFF)
set(CATKIN_PACKAGE_LIB_DESTINATION lib)  # of another component than what is packed
foreach(folder follow model kalman plausible contact raycast guard base scip virtual_urg)
  add_subdirectory(src/${folder})
endforeach()
include(src/core.cmake)
install(TARGETS _core LIBRARY DESTINATION kurumaisu COMPONENT wheel)

# Where kurumaisu.params.shipped looks.
set(share ${SKBUILD_DATA_DIR}/share/kurumaisu)
install(FILES package.xml DESTINATION ${share} COMPONENT wheel)
install(DIRECTORY launch worlds DESTINATION ${share} COMPONENT wheel FILES_MATCHING
  PATTERN *.yaml PATTERN *.world PATTERN *.inc PATTERN *.png PATTERN *.pgm)
install(PROGRAMS scripts/kurumaisu DESTINATION ${SKBUILD_SCRIPTS_DIR} COMPONENT wheel)
