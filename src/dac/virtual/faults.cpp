// SPDX-License-Identifier: BSD-3-Clause
#include "dac/virtual/faults.h"

#include <array>
#include <optional>
#include <regex>
#include <stdexcept>

namespace kurumaisu::dac {
namespace {

struct Entry {
  BoardFault::What what;
  const char* name;
  bool has_value;
  const char* text;
};

constexpr std::array<Entry, 8> kEntries{{
    {BoardFault::kSilent, "silent", false, "obeys, but does not answer"},
    {BoardFault::kDeaf, "deaf", false, "neither obeys nor answers"},
    {BoardFault::kWrong, "wrong", false, "obeys, but answers \"?\""},
    {BoardFault::kCut, "cut", false, "obeys; of its answer comes half, without an end"},
    {BoardFault::kLate, "late", true, "obeys at once, answers after so many seconds"},
    {BoardFault::kStall, "stall", true, "reads nothing for so many seconds"},
    {BoardFault::kLost, "lost", false, "puts out its lowest code, whatever is asked for, and says so"},
    {BoardFault::kUnplug, "unplug", true, "unplugged for so many seconds, back under a new terminal"},
}};

Signal signalOf(const std::string& name) {
  for (const Signal signal : kWriteOrder) {
    if (name == kSignalNames[signal]) return signal;
  }
  throw std::invalid_argument("a fault's signal is reference, translation or steering, not " + name);
}

}  // namespace

BoardFault boardFault(const std::string& text, std::uint64_t heard) {
  static const std::regex form(
      R"(([a-z]+)(/([a-z]+))?(@([1-9][0-9]{0,8}))?(x([1-9][0-9]{0,8}))?(=([0-9]{1,6}(\.[0-9]{1,9})?))?)");
  std::smatch match;
  if (text.size() > 60 || !std::regex_match(text, match, form)) {
    throw std::invalid_argument("a fault is NAME[/SIGNAL][@COMMAND][xCOUNT][=SECONDS], not " + text);
  }
  for (const Entry& entry : kEntries) {
    if (match[1] != entry.name) continue;
    if (entry.has_value != match[8].matched) {
      throw std::invalid_argument(text + ": " + entry.name +
                                  (entry.has_value ? " needs =SECONDS" : " takes no =SECONDS"));
    }
    return {entry.what, match[4].matched ? std::stoull(match[5]) : heard + 1,
            match[6].matched ? std::stoull(match[7]) : 1, entry.has_value ? std::stod(match[9]) : 0,
            match[2].matched ? std::optional(signalOf(match[3])) : std::nullopt};
  }
  throw std::invalid_argument(text + ": no such fault; there are\n" + boardFaults());
}

std::string boardFaults() {
  std::string result;
  for (const Entry& entry : kEntries) {
    const std::string name = std::string(entry.name) + (entry.has_value ? "=S" : "");
    result += "  " + name + std::string(10 - name.size(), ' ') + entry.text + "\n";
  }
  return result;
}

}  // namespace kurumaisu::dac
