// SPDX-License-Identifier: BSD-3-Clause
// Files that are there whole, or as they were before.
#pragma once

#include <functional>
#include <string>
#include <vector>

namespace kurumaisu {

struct WholeFile {
  std::string path;
  std::function<bool(const std::string&)>
      write;  // writes the file of the name it is given; false: it could not
};

/// Has the files of one result written under other names beside their own, and gives them their own when all are
/// whole and on the disk. Throws std::runtime_error naming the one that cannot be written.
void replaceWhole(const std::vector<WholeFile>& files);

WholeFile textFile(const std::string& path, const std::string& contents);

}  // namespace kurumaisu
