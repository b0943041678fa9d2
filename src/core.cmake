# kurumaisu._core, of the libraries that are there: for catkin (CMakeLists.txt) and for pip (wheel.cmake).
pybind11_add_module(_core NO_EXTRAS
  src/bindings.cpp
  src/base/bindings.cpp
  src/contact/bindings.cpp
  src/follow/bindings.cpp
  src/plausible/bindings.cpp
  src/raycast/bindings/arena.cpp
  src/raycast/bindings/camera.cpp
  src/raycast/bindings/cell_rays.cpp
  src/raycast/bindings/cells.cpp
  src/raycast/bindings/scene.cpp
  src/virtual_urg/bindings.cpp)
target_include_directories(_core PRIVATE src)
target_link_libraries(_core PRIVATE
  ${PROJECT_NAME}_base ${PROJECT_NAME}_contact ${PROJECT_NAME}_follow ${PROJECT_NAME}_kalman ${PROJECT_NAME}_model ${PROJECT_NAME}_plausible
  ${PROJECT_NAME}_raycast ${PROJECT_NAME}_virtual_urg)
