// SPDX-License-Identifier: BSD-3-Clause
#include "virtual_urg/faults.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <cmath>
#include <stdexcept>

namespace kurumaisu::virtual_urg {
namespace {

enum class Part { kNever, kMay, kMust };

struct Kind {
  const char* name;
  Part scan;
  Part value;
  const char* help;
};

constexpr Part kNever = Part::kNever;
constexpr Part kMay = Part::kMay;
constexpr Part kMust = Part::kMust;

// `err` stands for err01 to err98.
constexpr std::array kKinds{
    Kind{"corrupt", kMay, kNever, "a character of the data is changed, the sum is not"},
    Kind{"trunc", kMay, kNever, "half of the scan is missing, with its end"},
    Kind{"noend", kMay, kNever, "the two LF at the end are missing"},
    Kind{"badlf", kMay, kNever, "another byte than LF follows the status"},
    Kind{"garbage", kMay, kMay, "noise before the scan; value: bytes"},
    Kind{"dup", kMay, kNever, "the scan is sent twice"},
    Kind{"err", kMay, kMay, "errNN: status NN instead of the scan; value: for so many scans"},
    Kind{"zeros", kMay, kNever, "all distances are 0"},
    Kind{"codes", kMay, kNever, "the distances are 0 to 19, repeatedly"},
    Kind{"dribble", kMay, kMay, "the scan is sent slowly; value: over so many seconds, else 0.8 of a turn"},
    Kind{"stall", kMay, kMay, "the stream stops without notice; value: it is silent for so many seconds"},
    Kind{"close", kMay, kNever, "the connection is closed after the scan"},
    Kind{"rst", kMay, kNever, "the connection is reset after the scan"},
    Kind{"hangup", kMay, kMay, "the device is unplugged after the scan; value: for so many seconds"},
    Kind{"reboot", kMay, kMay, "power fails after the scan; value: boots for so many seconds"},
    Kind{"rst-after-cmd", kMay, kNever, "the connection is reset after a reply; @: to this command only"},
    Kind{"close-on-accept", kNever, kMay, "connections are closed at once; value: the first so many"},
    Kind{"blackhole", kNever, kNever, "nothing is accepted, heard or answered"},
    Kind{"t0", kNever, kMust, "value: its clock at the start [ms]"},
    Kind{"t-stands", kNever, kNever, "the clock of its scans stands"},
    Kind{"scip1", kNever, kNever, "it powers up in SCIP 1.1"},
    Kind{"strict-baud", kNever, kNever, "bytes at another bit rate are garbage"},
    Kind{"bm01", kNever, kNever, "BM: laser malfunction"},
    Kind{"md0e", kNever, kNever, "measurement commands are unknown"},
    Kind{"no-me", kNever, kNever, "ME and GE are unknown"},
    Kind{"vv-badsum", kNever, kNever, "VV: the sum of SERI is wrong"},
    Kind{"vv-deaf", kNever, kMust, "asked VV twice, it is deaf; value: for so many seconds"},
    Kind{"pp-ares0", kNever, kNever, "PP: ARES is 0"},
    Kind{"pp-crossed", kNever, kNever, "PP: AMIN and AMAX are exchanged"},
};

bool isStatus(std::string_view name) {
  return name.size() == 5 && name.substr(0, 3) == "err" &&
         std::isdigit(static_cast<unsigned char>(name[3])) &&
         std::isdigit(static_cast<unsigned char>(name[4])) && name.substr(3) != "00" &&
         name.substr(3) != "99";
}

const Kind& kindOf(std::string_view name, std::string_view text) {
  const std::string_view key = isStatus(name) ? name.substr(0, 3) : name;
  const auto found = std::find_if(kKinds.begin(), kKinds.end(), [&](const Kind& k) { return key == k.name; });
  if (found == kKinds.end() || name == "err") {
    throw std::invalid_argument("fault " + std::string(text) + ": no such name. There are:\n" + faultHelp());
  }
  return *found;
}

template <typename Number>
std::optional<Number> number(std::string_view digits) {
  Number value{};
  const char* end = digits.data() + digits.size();
  const auto [stop, error] = std::from_chars(digits.data(), end, value);
  if (error != std::errc() || stop != end) return std::nullopt;
  return value;
}

void require(bool holds, std::string_view text, const char* what) {
  if (!holds) throw std::invalid_argument("fault " + std::string(text) + ": " + what);
}

}  // namespace

Fault fault(std::string_view text) {
  const std::size_t equals = text.find('=');
  const std::string_view head = text.substr(0, equals);
  const std::size_t at = head.find('@');
  Fault result;
  result.name = head.substr(0, at);
  const Kind& kind = kindOf(result.name, text);
  if (at != std::string_view::npos) {
    require(kind.scan != kNever, text, "takes no @scan");
    result.scan = number<int>(head.substr(at + 1));
    require(result.scan && *result.scan >= 1, text, "@ needs a whole number from 1");
  }
  if (equals != std::string_view::npos) {
    require(kind.value != kNever, text, "takes no value");
    result.value = number<double>(text.substr(equals + 1));
    require(result.value && std::isfinite(*result.value) && *result.value >= 0, text,
            "= needs a number from 0");
  }
  require(kind.value != kMust || result.value, text, "needs a value: name=value");
  return result;
}

std::string faultHelp() {
  constexpr std::size_t kColumn = 28;
  std::string text;
  for (const Kind& kind : kKinds) {
    std::string line = std::string("  ") + kind.name;
    if (line == "  err") line += "NN";
    if (kind.scan != kNever) line += "[@n]";
    if (kind.value == kMay) line += "[=value]";
    if (kind.value == kMust) line += "=value";
    line.resize(std::max(kColumn, line.size() + 1), ' ');
    text += line + kind.help + "\n";
  }
  return text;
}

const Fault* Faults::find(std::string_view name) const {
  const auto found =
      std::find_if(faults_.begin(), faults_.end(), [&](const Fault& fault) { return fault.name == name; });
  return found == faults_.end() ? nullptr : &*found;
}

const Fault* Faults::find(std::string_view name, int scan) const {
  const auto found = std::find_if(faults_.begin(), faults_.end(), [&](const Fault& fault) {
    return fault.name == name && (!fault.scan || *fault.scan == scan);
  });
  return found == faults_.end() ? nullptr : &*found;
}

}  // namespace kurumaisu::virtual_urg
