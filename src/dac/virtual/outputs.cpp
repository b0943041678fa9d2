// SPDX-License-Identifier: BSD-3-Clause
#include "dac/virtual/outputs.h"

#include <fcntl.h>
#include <unistd.h>

#include <cmath>
#include <cstdio>

#include "steady.h"

namespace kurumaisu::dac {
namespace {

constexpr double kNearlyHalf = 0.501;  // [codes] what is rounded to neutral

Descriptor openLog(const std::string& file) {
  if (file.empty()) return Descriptor();
  const int fd = ::open(file.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0644);
  return Descriptor(checked(fd, file));
}

}  // namespace

Outputs::Outputs(const Channels& channels, const Codings& codings, const std::string& log)
    : channels_(channels), codings_(codings), log_(openLog(log)) {}

void Outputs::put(const std::vector<std::pair<Signal, int>>& codes) {
  const std::int64_t time = steadyNanoseconds();
  const std::array<int, kSignals> before = codes_;
  for (const auto& [signal, code] : codes) codes_[signal] = code;
  if (codes_ == before) return;
  const Volts now = volts();
  history_.push_back({time, now});
  std::array<char, 100> text{};
  std::snprintf(text.data(), text.size(), "volts %.6f %.6f %.6f", now.translation, now.steering,
                now.reference);
  log(time, text.data());
}

void Outputs::note(const std::string& what) const { log(steadyNanoseconds(), what); }

void Outputs::log(std::int64_t time, const std::string& what) const {
  if (!log_) return;
  const std::string line = std::to_string(time) + " " + what + "\n";
  if (::write(log_.get(), line.data(), line.size()) < 0) std::perror("the virtual board's log");
}

Volts Outputs::volts() const {
  std::array<double, kSignals> pins{};
  for (const Signal signal : kWriteOrder) {
    const Coding& coding = codings_[signal];
    pins[signal] = (codes_[signal] - coding.at_zero) / coding.per_volt;
    if (signal != kReference && channels_[signal].add_reference) pins[signal] -= pins[kReference];
  }
  return {pins[kTranslation], pins[kSteering], pins[kReference]};
}

bool Outputs::isNeutral(const Volts& volts) const {
  const Band& reference = channels_[kReference].volt;
  const auto near = [this](double volt, Signal signal) {
    return std::abs(volt * codings_[signal].per_volt) < kNearlyHalf;
  };
  return near(volts.translation, kTranslation) && near(volts.steering, kSteering) &&
         volts.reference >= reference.min && volts.reference <= reference.max;
}

}  // namespace kurumaisu::dac
