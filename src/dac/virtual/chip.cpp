// SPDX-License-Identifier: BSD-3-Clause
#include "dac/virtual/chip.h"

#include <poll.h>
#include <pthread.h>
#include <sys/inotify.h>
#include <unistd.h>

#include <array>
#include <cmath>
#include <csignal>
#include <fstream>
#include <optional>
#include <stdexcept>
#include <system_error>

#include "dac/virtual/faults.h"
#include "steady.h"

namespace kurumaisu::dac {
namespace {

namespace fs = std::filesystem;

constexpr double kSupply = 5;               // [V] the end of its range
constexpr double kMillivoltsOfVolt = 1000;  // [1/V]

const IioSettings& iioOf(const Device& device) {
  const auto* iio = std::get_if<IioSettings>(&device.back_end);
  if (iio == nullptr)
    throw std::invalid_argument(device.file + ": kind must be iio: a virtual chip has no other kind");
  if (iio->device.front() != '/') return *iio;
  throw std::invalid_argument(device.file +
                              ": device: a virtual chip must be called by its name: " + iio->device);
}

Codings codingsOf(const IioSettings& settings) {
  Codings codings{};
  const int codes = 1 << settings.bits;
  for (Coding& coding : codings) coding = {codes / kSupply, 0, 0, codes - 1};
  return codings;
}

void write(const fs::path& file, const std::string& text) { std::ofstream(file) << text << '\n'; }

/// The code in a file; none while it is being written.
std::optional<int> codeIn(const fs::path& file) {
  int code = 0;
  return std::ifstream(file) >> code ? std::optional(code) : std::nullopt;
}

}  // namespace

VirtualChip::VirtualChip(const Device& device, const std::string& root, const std::string& log)
    : settings_(iioOf(device)),
      root_(root),
      folder_(root_ / "iio:device0"),
      outputs_(device.channels, codingsOf(settings_), log) {
  if (!fs::create_directory(root_))
    throw std::invalid_argument(root + ": exists already");  // it goes in the end
  plug();
  thread_ = std::thread(&VirtualChip::run, this);
}

VirtualChip::~VirtualChip() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  wake_.set();
  thread_.join();
  std::error_code ignored;
  fs::remove_all(root_, ignored);
}

std::string VirtualChip::attribute(Signal signal, const std::string& suffix) const {
  return folder_ / ("out_voltage" + std::to_string(settings_.index[signal]) + suffix);
}

void VirtualChip::plug() {
  fs::create_directories(folder_);
  for (const Signal signal : kWriteOrder) {
    write(attribute(signal, "_raw"), std::to_string(outputs_.codes()[signal]));
    write(attribute(signal, "_scale"), std::to_string(kMillivoltsOfVolt * kSupply / (1 << settings_.bits)));
    write(attribute(signal, "_powerdown"), "1");
  }
  watch_ = Descriptor(checked(inotify_init1(IN_NONBLOCK | IN_CLOEXEC), "inotify"));
  for (const Signal signal : kWriteOrder) {
    const std::string file = attribute(signal, "_raw");
    checked(inotify_add_watch(watch_.get(), file.c_str(), IN_MODIFY), file);
  }
  write(folder_ / "name", settings_.device);  // the last: by it the chip is found
}

void VirtualChip::unplug() {
  watch_.close();
  fs::remove_all(folder_);
}

void VirtualChip::inject(const std::string& fault) {
  const BoardFault read = boardFault(fault, 0);
  if (read.what != BoardFault::kUnplug) throw std::invalid_argument(fault + ": a chip can only be unplugged");
  const std::lock_guard lock(mutex_);
  unplug();
  back_at_ = steadyTime() + read.value;
  outputs_.note("unplugged");
  wake_.set();
}

Volts VirtualChip::volts() const {
  const std::lock_guard lock(mutex_);
  return outputs_.volts();
}

std::size_t VirtualChip::changes() const {
  const std::lock_guard lock(mutex_);
  return outputs_.history().size();
}

void VirtualChip::run() {
  sigset_t all;
  sigfillset(&all);
  pthread_sigmask(SIG_BLOCK, &all, nullptr);  // they are for the program, not for this thread
  for (;;) {
    std::unique_lock lock(mutex_);
    if (stopping_) return;
    serve(lock);
  }
}

void VirtualChip::serve(std::unique_lock<std::mutex>& lock) {
  const double left = back_at_ - steadyTime();
  if (back_at_ > 0 && left <= 0) {
    back_at_ = 0;
    plug();
    outputs_.note("plugged");
  }
  read();
  std::array<pollfd, 2> ready{{{wake_.descriptor(), POLLIN, 0}, {watch_.get(), POLLIN, 0}}};
  const int timeout = back_at_ > 0 ? static_cast<int>(std::ceil(1e3 * left)) : -1;
  lock.unlock();
  poll(ready.data(), ready.size(), timeout);
  lock.lock();
  if (ready[0].revents != 0) wake_.clear();
}

/// Whatever was written last counts: which of the files it was the events need not tell.
void VirtualChip::read() {
  if (!watch_) return;
  alignas(inotify_event) std::array<char, 4096> events;
  while (::read(watch_.get(), events.data(), events.size()) > 0) {
  }
  std::vector<std::pair<Signal, int>> codes;
  for (const Signal signal : kWriteOrder) {
    if (const std::optional<int> code = codeIn(attribute(signal, "_raw"))) codes.emplace_back(signal, *code);
  }
  outputs_.put(codes);
}

}  // namespace kurumaisu::dac
