// SPDX-License-Identifier: BSD-3-Clause
#include <array>
#include <iomanip>
#include <sstream>
#include <stdexcept>

#include "slam/mapping/saved_map.h"
#include "slam/mapping/whole_file.h"

namespace kurumaisu {
namespace {

// As map_saver has them: src/kurumaisu/map_file.py, which reads the pair back in a test of mapping_node.
constexpr int kOccupiedAbove = 65;         // [%]
constexpr double kFreeBelow = 19.6;        // [%]
constexpr unsigned char kWallShade = 0;    // shades
constexpr unsigned char kFreeShade = 254;  // 255 would be as free
constexpr unsigned char kUnknown = 205;

std::string imageOf(const OccupancyGrid& grid) {
  std::ostringstream out;
  out << "P5\n" << grid.width << ' ' << grid.height << "\n255\n";
  for (int y = grid.height - 1; y >= 0; --y) {
    for (int x = 0; x < grid.width; ++x) {
      const int cell = grid.cells[static_cast<std::size_t>(y) * grid.width + x];
      out.put(static_cast<char>(cell > kOccupiedAbove            ? kWallShade
                                : cell >= 0 && cell < kFreeBelow ? kFreeShade
                                                                 : kUnknown));
    }
  }
  return out.str();
}

std::string textOf(const OccupancyGrid& grid, const std::string& image) {
  std::ostringstream out;
  out << std::setprecision(12) << "image: '" << image << "'\nresolution: " << grid.resolution << "\norigin: ["
      << grid.x << ", " << grid.y << ", 0.0]\nnegate: 0\noccupied_thresh: " << kOccupiedAbove / 100.0
      << "\nfree_thresh: " << kFreeBelow / 100.0 << '\n';
  return out.str();
}

}  // namespace

void writeMapPair(const std::string& path, const OccupancyGrid& grid) {
  if (grid.cells.empty()) throw std::runtime_error(path + ": nothing has been mapped yet");
  std::string image = path.substr(path.find_last_of('/') + 1) + ".pgm";
  for (std::size_t at = 0; (at = image.find('\'', at)) != std::string::npos; at += 2)
    image.insert(at, 1, '\'');
  replaceWhole({textFile(path + ".pgm", imageOf(grid)), textFile(path + ".yaml", textOf(grid, image))});
}

}  // namespace kurumaisu
