// SPDX-License-Identifier: BSD-3-Clause
// What may be read: a regular file of bounded size. A pipe would wait for who writes into it.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <system_error>

namespace kurumaisu {

/// Why a file is not read, as `must be a regular file`; empty: it may be.
inline std::string whyNotRead(const std::string& path, std::uintmax_t most_bytes) {
  std::error_code error;
  const std::filesystem::file_status status = std::filesystem::status(path, error);
  if (!std::filesystem::exists(status)) return "cannot be read";
  if (!std::filesystem::is_regular_file(status)) return "must be a regular file";
  const std::uintmax_t size = std::filesystem::file_size(path, error);
  if (error) return "cannot be read";
  if (size <= most_bytes) return "";
  return "has " + std::to_string(size) + " bytes, and at most " + std::to_string(most_bytes) + " are read";
}

}  // namespace kurumaisu
