// SPDX-License-Identifier: BSD-3-Clause
// Lines of cells, as Stage draws them.
#pragma once

#include <cstdint>
#include <cstdlib>

namespace kurumaisu {

/// Steps to one of four neighbours along a line, so many as its ends differ in columns and rows.
struct Walk {
  Walk(std::int64_t column, std::int64_t row, std::int64_t columns, std::int64_t rows)
      : x(column),
        y(row),
        wide(std::abs(columns)),
        high(std::abs(rows)),
        left(wide + high),
        right(columns < 0 ? -1 : 1),
        up(rows < 0 ? -1 : 1),
        excess(high - wide) {}

  void step() {
    if (excess < 0) {
      x += right;
      excess += 2 * high;
    } else {
      y += up;
      excess -= 2 * wide;
    }
    --left;
  }

  std::int64_t x, y;
  std::int64_t wide, high;
  std::int64_t left;  ///< steps still to go

 private:
  std::int64_t right, up;
  std::int64_t excess;  ///< negative: the next step is along a row
};

}  // namespace kurumaisu
