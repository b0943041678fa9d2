// SPDX-License-Identifier: BSD-3-Clause
// Files that are there whole, or as they were before.
#pragma once

#include <functional>
#include <string>

namespace kurumaisu {

/// Has a file written under another name beside its own, and gives it its own when it is whole and on the disk.
/// write: writes the file of the name it is given; false: it could not. Throws std::runtime_error naming path.
void replaceWhole(const std::string& path, const std::function<bool(const std::string&)>& write);

void writeWhole(const std::string& path, const std::string& contents);

}  // namespace kurumaisu
