// SPDX-License-Identifier: BSD-3-Clause
// Many robots among walls: what their sensors see, and where they may go.
#pragma once

#include <cstddef>
#include <memory>
#include <mutex>
#include <vector>

#include "raycast/beams.h"
#include "raycast/bodies.h"
#include "raycast/contact.h"
#include "raycast/layers.h"
#include "raycast/pool.h"
#include "raycast/sight.h"

namespace kurumaisu {

/// Walls that stay and bodies that move. All results are the same for any number of threads.
///
/// Errors are std::invalid_argument, and nothing has changed then. One call at a time; others wait.
class Arena {
 public:
  Arena(std::vector<Wall> walls, int threads);

  /// A body in the map's origin, at heading 0; returns its number.
  int add(std::vector<Face> faces, int tree);
  void remove(int body);
  void setPoses(const std::vector<int>& bodies, const Pose* poses);

  /// Beams of each fan in turn, as one sequence: the nearest visible thing, or +inf and 0.
  void scan(const std::vector<Viewpoint>& from, const std::vector<Beams>& fans, double* ranges,
            double* returns);

  /// One ray from each place, along its heading.
  void cast(const std::vector<Viewpoint>& from, double range_max, double* ranges, double* returns);

  /// Whether solid outlines of each body touch solid outlines of another tree, or the ground.
  void touches(const std::vector<int>& bodies, bool* out);

  /// Stage's motion: in the order given each body goes to its pose as a whole, or stays if it would touch.
  ///
  /// Neighbours in the sequence with the same group go together or not at all; no groups: each on its own.
  void move(const std::vector<int>& bodies, const Pose* poses, const std::vector<int>& groups, bool* stalled);

 private:
  void requireKnown(const std::vector<int>& bodies) const;
  const Contact& contact();
  bool moveGroup(const int* bodies, const Pose* poses, std::size_t count);

  std::mutex mutex_;
  std::vector<Wall> walls_;
  Layers layers_;
  std::unique_ptr<Contact> contact_;  ///< made when the first body moves
  Bodies bodies_;
  Pool pool_;
};

}  // namespace kurumaisu
