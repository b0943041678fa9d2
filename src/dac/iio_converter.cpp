// SPDX-License-Identifier: BSD-3-Clause
#include "dac/iio_converter.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <vector>

namespace kurumaisu::dac {
namespace {

namespace fs = std::filesystem;

constexpr double kMillivolts = 1000;  // [1/V]

std::string firstLine(const fs::path& file) {
  std::ifstream stream(file);
  std::string line;
  std::getline(stream, line);
  return line;
}

/// The folder of the only device of that name.
std::string findDevice(const std::string& root, const std::string& name) {
  if (name.front() == '/') return name;
  std::vector<std::string> found;
  std::error_code error;
  for (const fs::directory_entry& entry : fs::directory_iterator(root, error)) {
    if (firstLine(entry.path() / "name") == name) found.push_back(entry.path());
  }
  std::sort(found.begin(), found.end());
  if (found.size() == 1) return found.front();
  if (found.empty()) throw Fault("DAC_NO_PORT: no device in " + root + " has the name " + name);
  throw Fault("DAC_NO_PORT: " + found[0] + " and " + found[1] + " both have the name " + name +
              ": give the folder as device");
}

std::optional<double> numberOf(const std::string& text) {
  const char* const end = text.data() + text.size();
  double value = 0;
  const auto result = std::from_chars(text.data(), end, value);
  if (result.ec != std::errc() || result.ptr != end || !std::isfinite(value)) return std::nullopt;
  return value;
}

}  // namespace

IioConverter::IioConverter(const Device& device)
    : file_(device.file), channels_(device.channels), settings_(std::get<IioSettings>(device.back_end)) {
  open();
}

std::string IioConverter::name() const {
  return "iio " + settings_.device + (attributes_ ? ": " + attributes_->folder() : "");
}

std::string IioConverter::attribute(Signal signal, const std::string& suffix) const {
  return "out_voltage" + std::to_string(settings_.index[signal]) + suffix;
}

/// An attribute of the channel, or of all channels.
double IioConverter::number(Signal signal, const std::string& suffix, std::optional<double> otherwise) const {
  std::optional<std::string> text = attributes_->readIfThere(attribute(signal, suffix));
  if (!text) text = attributes_->readIfThere("out_voltage" + suffix);
  if (!text && otherwise) return *otherwise;
  const std::string name = attributes_->folder() + "/" + attribute(signal, suffix);
  if (!text)
    throw Fault("DAC_NO_PORT: " + name + " is missing: " + kSignalNames[signal] + " is not an output");
  if (const std::optional<double> value = numberOf(*text)) return *value;
  throw Fault("DAC_REFUSED: " + name + " is not a number: " + *text);
}

void IioConverter::open() {
  attributes_.reset();
  powered_ = false;
  attributes_.emplace(findDevice(settings_.root, settings_.device));
  for (const Signal signal : kWriteOrder) {
    attributes_->read(attribute(signal, "_raw"));
    const double scale = number(signal, "_scale", std::nullopt);
    if (scale <= 0) throw Fault("DAC_REFUSED: " + attribute(signal, "_scale") + " must be above 0");
    codings_[signal] = {kMillivolts / scale, -number(signal, "_offset", 0), 0, (1 << settings_.bits) - 1};
  }
  const std::string reason = misfit(channels_, codings_);
  if (reason.empty()) return;
  attributes_.reset();
  throw std::invalid_argument(file_ + ": channels: " + reason);
}

void IioConverter::reopen() {
  try {
    open();
  } catch (const Fault&) {
    attributes_.reset();
    throw;
  } catch (const std::invalid_argument& error) {
    throw Fault(std::string("DAC_REFUSED: the range has changed: ") + error.what());
  }
}

void IioConverter::write(Signal signal, int code) const {
  const std::string name = attribute(signal, "_raw");
  attributes_->write(name, std::to_string(code) + "\n");
  if (!settings_.read_back) return;
  const std::string held = attributes_->read(name);
  if (held == std::to_string(code)) return;
  throw Fault("DAC_WRONG_REPLY: " + attributes_->folder() + "/" + name + " (" + kSignalNames[signal] +
              ") holds " + held + ", not " + std::to_string(code));
}

Volts IioConverter::put(const Volts& volts) {
  const Levels levels = levelsOf(volts, channels_, codings_);
  if (!attributes_) throw Fault("DAC_CLOSED: " + settings_.device + " must be opened again");
  std::optional<Fault> fault;
  for (const Signal signal :
       kWriteOrder) {  // all of them: the one that fails may not be the one that stops the chair
    try {
      write(signal, levels[signal].code);
    } catch (const Fault& error) {
      if (!fault) fault = error;
    }
  }
  if (fault) throw Fault(*fault);
  // A chip that is powered up before it has its voltages puts out what it last held.
  for (const Signal signal : kWriteOrder) {
    if (settings_.power_up && !powered_) attributes_->write(attribute(signal, "_powerdown"), "0\n");
  }
  powered_ = true;
  return voltsOf(levels);
}

}  // namespace kurumaisu::dac
