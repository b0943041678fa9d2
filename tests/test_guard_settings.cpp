// SPDX-License-Identifier: BSD-3-Clause
// The guard's file: what ships is read and safe, and what is misspelt, missing or senseless is named.
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <regex>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "guard/settings.h"

namespace test_guard_settings {

namespace g = kurumaisu::guard;
namespace fs = std::filesystem;

namespace {

const fs::path kShipped = SHIPPED;

std::string textOf(const fs::path& file) {
  std::ifstream in(file);
  std::ostringstream text;
  text << in.rdbuf();
  return text.str();
}

/// The message with which a changed file is refused; "" if it is not.
std::string complaint(const std::string& file, const std::string& from, const std::string& to) {
  std::string name = (fs::temp_directory_path() / "guard_XXXXXX").string();
  const fs::path folder = mkdtemp(name.data());
  for (const char* each : {"guard.yaml", "md100.yaml"}) {
    const std::string text = textOf(kShipped / each);
    std::ofstream(folder / each) << (each == file ? std::regex_replace(text, std::regex(from), to) : text);
  }
  std::string result;
  try {
    g::readSettings(folder / "guard.yaml");
  } catch (const std::invalid_argument& error) {
    result = error.what();
  }
  fs::remove_all(folder);
  return result;
}

TEST(GuardSettings, WhatShipsHoldsWhatIsPromised) {
  const g::Settings settings = g::readSettings(kShipped / "guard.yaml");
  EXPECT_GE(settings.limits.arming, 0.5);
  EXPECT_LE(settings.limits.silence, 0.15);
  EXPECT_EQ(settings.limits.reference, 2.5);
  EXPECT_NEAR(settings.limits.translation.high, 2.2, 1e-6);
  EXPECT_GT(settings.limits.translation.step, 0.127906 + 0.108783);  // from branch to branch
  EXPECT_GT(settings.limits.steering.step, 0.169476 + 0.104181);
  EXPECT_EQ(complaint("", "", ""), "");
}

struct Wrong {
  const char* file;
  const char* from;
  const char* to;
  const char* words;
};

TEST(GuardSettings, WhatIsWrongIsNamed) {
  const std::vector<Wrong> wrongs = {
      {"guard.yaml", "silence:", "silense:", "limits/silence: is missing"},
      {"guard.yaml", "priority: 40", "priority: 40\npriorty: 1", "priorty: is not a known key"},
      {"guard.yaml", "priority: 40", "priority: 100", "priority: must be at most 99"},
      {"guard.yaml", "arming: 0.5", "arming: 0.1", "limits: silence must be shorter than arming"},
      {"guard.yaml", "age: 0.1", "age: 1e-1", "age: must be a number"},
      {"guard.yaml", "step: 0.5", "step: 0", "step: must be above 0"},
      {"guard.yaml", "rate: 25.0", "rate: -1", "rate: must be above 0"},
      {"guard.yaml", "period: 0.02", "period: 9.0", "sentinel_silence: must be longer than period"},
      {"guard.yaml", "first: 0.02", "first: 0.9", "longest: must be at least 0.9"},
      {"guard.yaml", "md100.yaml", "md200.yaml", "md200.yaml: cannot be read"},
      {"md100.yaml", "reference_voltage:", "reference:", "reference_voltage: is missing"},
      {"md100.yaml", "steering: \\{min: -1.0, max: 1.0", "steering: {min: 0.5, max: 1.0",
       "limits: a band must reach from below 0 V to above 0 V"},
  };
  for (const Wrong& wrong : wrongs) {
    const std::string said = complaint(wrong.file, wrong.from, wrong.to);
    EXPECT_NE(said.find(wrong.words), std::string::npos) << wrong.words << ": " << said;
    EXPECT_NE(said.find(".yaml"), std::string::npos) << said;
  }
}

}  // namespace

}  // namespace test_guard_settings
