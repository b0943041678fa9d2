// SPDX-License-Identifier: BSD-3-Clause
// A device's file in a folder of its own, and a virtual board for it.
#pragma once

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <memory>
#include <sstream>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "dac/open.h"
#include "dac/virtual/board.h"

namespace kurumaisu::dac {

constexpr double kLong = 10;  // [s] a deadline that only a failure meets

/// A folder that goes in the end.
class Folder {
 public:
  Folder() {
    std::string name = (std::filesystem::temp_directory_path() / "dacXXXXXX").string();
    if (mkdtemp(name.data()) == nullptr) throw std::runtime_error(name);
    path_ = name;
  }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;
  ~Folder() { std::filesystem::remove_all(path_); }

  std::string operator/(const std::string& name) const { return path_ / name; }

 private:
  std::filesystem::path path_;
};

inline std::string textOf(const std::string& file) {
  std::ifstream stream(file);
  std::ostringstream text;
  text << stream.rdbuf();
  return text.str();
}

inline std::string shipped(const std::string& name) { return SOURCE_DIR "/launch/dac/" + name; }

using Edits = std::vector<std::pair<std::string, std::string>>;

/// Text with each first part, which must be there, replaced by the second, once.
inline std::string edited(std::string text, const Edits& edits) {
  for (const auto& [from, to] : edits) {
    const std::size_t at = text.find(from);
    if (at == std::string::npos) throw std::logic_error("not there: " + from);
    text.replace(at, from.size(), to);
  }
  return text;
}

inline std::string written(const Folder& folder, const std::string& name, const std::string& text) {
  std::ofstream(folder / name) << text;
  return folder / name;
}

/// What an action throws of a kind; empty if it throws nothing.
template <typename Error>
std::string complaint(const std::function<void()>& action) {
  try {
    action();
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

inline bool has(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

/// The shipped example's board, plugged in.
struct Rig {
  explicit Rig(const Edits& edits = {})
      : device(deviceOf(edits)), board(device, folder / "port", folder / "log") {}

  std::unique_ptr<Converter> open() const { return openAndPrepare(device); }

  Device deviceOf(const Edits& edits) const {
    Edits all{{"port: /dev/kurumaisu_dac", "port: " + (folder / "port")},
              {"reply_timeout: 0.05", "reply_timeout: 0.4"},  // this computer may be busy
              {"late_reply: 0.1", "late_reply: 0.8"},
              {"boot: 3.0", "boot: 0.1"}};
    all.insert(all.end(), edits.begin(), edits.end());
    return readDevice(written(folder, "device.yaml", edited(textOf(shipped("serial_ascii.yaml")), all)));
  }

  bool heardAll(std::uint64_t commands) const {
    return board.wait([&] { return board.commands() >= commands; }, kLong);
  }

  Folder folder;
  Device device;
  VirtualBoard board;
};

/// One command for all three, and all replies alike.
inline const Edits kOneFrame{
    {"frame: channel ", "frame: all "},
    {R"("W{ch}{code:04X}")", R"("S{reference.code:03X}{translation.code:03X}{steering.code:03X}")"},
    {R"("OK {ch}{code:04X}")", R"("OK")"}};

/// One command for each, sent without waiting.
inline const Edits kBurst{{"frame: channel ", "frame: burst "}};

constexpr Volts kNeutral{0, 0, 2.5};
constexpr Volts kMoving{0.5, -0.25, 2.5};

}  // namespace kurumaisu::dac
