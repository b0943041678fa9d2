// SPDX-License-Identifier: BSD-3-Clause
// Ray casting over cells, to the letter as Stage does it.
#pragma once

#include <cstddef>
#include <mutex>
#include <vector>

#include "raycast/beams.h"
#include "raycast/cells/drawing.h"
#include "raycast/cells/regions.h"
#include "raycast/pool.h"
#include "raycast/sight.h"

namespace kurumaisu {

/// What rangers see where outlines are drawn into cells. Results are the same for any number of threads.
///
/// Errors are std::invalid_argument, and nothing has changed then. One call at a time; others wait.
class CellRays {
 public:
  /// resolution: edge of a cell [m].
  CellRays(double resolution, int threads);

  /// Outlines in the map's origin, at heading 0; returns their number.
  ///
  /// returns: ranger return of each part; below 0: no ray meets it, but its regions are not empty.
  int add(Outline outline, std::vector<double> returns, int tree);

  /// Those that are there already cost nothing.
  void setPoses(const std::vector<int>& things, const Pose* poses);

  /// Beams of each fan in turn, as one sequence: where they meet the first visible cell, or +inf and 0.
  void scan(const std::vector<Viewpoint>& from, const std::vector<Beams>& fans, double* ranges,
            double* returns);

  /// One ray from each place, along its heading.
  void cast(const std::vector<Viewpoint>& from, double range_max, double* ranges, double* returns);

 private:
  struct Thing {
    Outline outline;
    std::vector<double> returns;
    double reach;  ///< [m] from its frame
    int tree;
    Pose pose;
    Drawing drawing;
  };

  const Thing& at(int thing) const { return things_[static_cast<std::size_t>(thing)]; }
  void require(const Viewpoint& from, double range_max) const;
  Echo cast(const Viewpoint& from, double direction, double range_max) const;
  const double* seen(const Regions::Region& region, const Cell& cell, const Viewpoint& from) const;

  std::mutex mutex_;
  double cells_per_metre_;
  Pencil pencil_;
  Regions regions_;
  std::vector<Thing> things_;
  Pool pool_;
};

}  // namespace kurumaisu
