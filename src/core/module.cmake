# kurumaisu._core: for catkin, ../../CMakeLists.txt, and for pip, CMakeLists.txt beside this.
pybind11_add_module(_core NO_EXTRAS
  ${PROJECT_SOURCE_DIR}/src/bindings.cpp
  ${PROJECT_SOURCE_DIR}/src/base/bindings.cpp
  ${PROJECT_SOURCE_DIR}/src/contact/bindings.cpp
  ${PROJECT_SOURCE_DIR}/src/follow/bindings.cpp
  ${PROJECT_SOURCE_DIR}/src/plausible/bindings.cpp
  ${PROJECT_SOURCE_DIR}/src/raycast/bindings/arena.cpp
  ${PROJECT_SOURCE_DIR}/src/raycast/bindings/camera.cpp
  ${PROJECT_SOURCE_DIR}/src/raycast/bindings/cell_rays.cpp
  ${PROJECT_SOURCE_DIR}/src/raycast/bindings/cells.cpp
  ${PROJECT_SOURCE_DIR}/src/raycast/bindings/scene.cpp
  ${PROJECT_SOURCE_DIR}/src/virtual_urg/bindings.cpp
  ${PROJECT_SOURCE_DIR}/src/wire/bindings.cpp)
target_include_directories(_core PRIVATE ${PROJECT_SOURCE_DIR}/src)
target_link_libraries(_core PRIVATE
  ${PROJECT_NAME}_base ${PROJECT_NAME}_contact ${PROJECT_NAME}_follow ${PROJECT_NAME}_kalman ${PROJECT_NAME}_model ${PROJECT_NAME}_plausible
  ${PROJECT_NAME}_raycast ${PROJECT_NAME}_virtual_urg)
