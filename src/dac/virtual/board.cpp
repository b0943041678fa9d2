// SPDX-License-Identifier: BSD-3-Clause
#include "dac/virtual/board.h"

#include <poll.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <csignal>
#include <ctime>
#include <stdexcept>

#include "steady.h"

namespace kurumaisu::dac {
namespace {

constexpr double kNap = 0.2;  // [s] at most between two looks

const SerialSettings& serialOf(const Device& device) {
  const auto* serial = std::get_if<SerialSettings>(&device.back_end);
  if (serial != nullptr) return *serial;
  throw std::invalid_argument(device.file + ": kind must be serial: a virtual board has no other port");
}

}  // namespace

VirtualBoard::VirtualBoard(const Device& device, const std::string& link, const std::string& log)
    : settings_(serialOf(device)),
      reader_(settings_),
      outputs_(device.channels, settings_.codings, log),
      pty_(link),
      thread_(&VirtualBoard::run, this) {}

VirtualBoard::~VirtualBoard() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  wake_.set();
  thread_.join();
}

void VirtualBoard::inject(const std::string& fault) {
  const std::lock_guard lock(mutex_);
  const BoardFault read = boardFault(fault, commands_);
  const bool at_once = fault.find('@') == std::string::npos;
  if (read.what == BoardFault::kUnplug && at_once) return unplug(read.value);
  if (read.what == BoardFault::kStall && at_once) {
    stalled_until_ = steadyTime() + read.value;
  } else {
    faults_.push_back(read);
  }
  wake_.set();
}

std::vector<Change> VirtualBoard::history() const {
  const std::lock_guard lock(mutex_);
  return outputs_.history();
}

Volts VirtualBoard::volts() const {
  const std::lock_guard lock(mutex_);
  return outputs_.volts();
}

std::array<int, kSignals> VirtualBoard::codes() const {
  const std::lock_guard lock(mutex_);
  return outputs_.codes();
}

std::uint64_t VirtualBoard::commands() const {
  const std::lock_guard lock(mutex_);
  return commands_;
}

std::uint64_t VirtualBoard::misheard() const {
  const std::lock_guard lock(mutex_);
  return misheard_;
}

std::vector<std::string> VirtualBoard::heard() const {
  const std::lock_guard lock(mutex_);
  return heard_;
}

bool VirtualBoard::wait(const std::function<bool()>& so, double timeout) const {
  const double until = steadyTime() + timeout;
  while (!so()) {
    std::unique_lock lock(mutex_);
    if (steadyTime() >= until) return false;
    changed_.wait_for(lock, std::chrono::milliseconds(1));
  }
  return true;
}

void VirtualBoard::run() {
  sigset_t all;
  sigfillset(&all);
  pthread_sigmask(SIG_BLOCK, &all, nullptr);  // they are for the program, not for this thread
  std::unique_lock lock(mutex_);
  while (!stopping_) serve(lock);
}

void VirtualBoard::serve(std::unique_lock<std::mutex>& lock) {
  const double now = steadyTime();
  if (back_at_ > 0 && now >= back_at_) {
    back_at_ = 0;
    pty_.plug();
    outputs_.note("plugged");
  }
  flush(now);
  double until = now + kNap;
  for (const Reply& reply : replies_) until = std::min(until, reply.at);
  if (back_at_ > 0) until = std::min(until, back_at_);
  const bool deaf = back_at_ > 0 || now < stalled_until_;
  if (deaf && stalled_until_ > now) until = std::min(until, stalled_until_);
  std::array<pollfd, 2> ready{{{wake_.descriptor(), POLLIN, 0}, {deaf ? -1 : pty_.descriptor(), POLLIN, 0}}};
  const double seconds = std::max(0.0, until - now);
  const timespec timeout{static_cast<std::time_t>(seconds),
                         static_cast<long>(1e9 * (seconds - std::floor(seconds)))};
  lock.unlock();
  ppoll(ready.data(), ready.size(), &timeout, nullptr);
  lock.lock();
  if (ready[0].revents != 0) wake_.clear();
  if (ready[1].revents != 0 && back_at_ == 0) receive();
  changed_.notify_all();
}

void VirtualBoard::receive() {
  if (!pty_.connected()) {
    pty_.accept();
    return;
  }
  const std::optional<std::string> bytes = pty_.read();
  if (!bytes) {  // whoever comes next does not get the end of a line begun by another
    input_.clear();
    replies_.clear();
    return;
  }
  input_ += *bytes;
  for (std::size_t end = input_.find(settings_.terminator); end != std::string::npos;
       end = input_.find(settings_.terminator)) {
    const std::string line = input_.substr(0, end);
    input_.erase(0, end + settings_.terminator.size());
    obey(line);
  }
}

const BoardFault* VirtualBoard::faultNow(const std::optional<BoardReader::Heard>& heard) const {
  const auto concerns = [&heard](Signal signal) {
    return heard && std::any_of(heard->codes.begin(), heard->codes.end(),
                                [signal](const auto& code) { return code.first == signal; });
  };
  const auto found = std::find_if(faults_.begin(), faults_.end(), [&](const BoardFault& fault) {
    return fault.at <= commands_ && commands_ < fault.at + fault.count &&
           (!fault.signal || concerns(*fault.signal));
  });
  return found == faults_.end() ? nullptr : &*found;
}

void VirtualBoard::obey(const std::string& line) {
  ++commands_;
  heard_.push_back(line);
  std::optional<BoardReader::Heard> heard = reader_.hear(line, false);
  const BoardFault* const fault = faultNow(heard);
  if (fault != nullptr && fault->what == BoardFault::kUnplug) return unplug(fault->value);
  if (fault != nullptr && fault->what == BoardFault::kStall) stalled_until_ = steadyTime() + fault->value;
  if (fault != nullptr && fault->what == BoardFault::kLost) heard = reader_.hear(line, true);
  if (!heard) ++misheard_;
  const bool obeys = fault == nullptr || fault->what != BoardFault::kDeaf;
  if (obeys && heard) outputs_.put(heard->codes);
  if (fault != nullptr && (!obeys || fault->what == BoardFault::kSilent)) return;
  if (heard && heard->reply.empty()) return;
  std::string reply = (heard ? heard->reply : "?") + settings_.reply_terminator;
  if (fault != nullptr && fault->what == BoardFault::kWrong) reply = "?" + settings_.reply_terminator;
  if (fault != nullptr && fault->what == BoardFault::kCut) reply.resize((reply.size() - 1) / 2);
  const double delay = fault != nullptr && fault->what == BoardFault::kLate ? fault->value : 0;
  replies_.push_back({steadyTime() + delay, reply});
  flush(steadyTime());
}

void VirtualBoard::unplug(double seconds) {
  pty_.unplug();
  input_.clear();
  replies_.clear();
  back_at_ = steadyTime() + seconds;
  outputs_.note("unplugged");
  wake_.set();
}

void VirtualBoard::flush(double now) {
  for (auto reply = replies_.begin(); reply != replies_.end();) {
    if (reply->at > now) {
      ++reply;
      continue;
    }
    if (back_at_ == 0) pty_.write(reply->bytes);
    reply = replies_.erase(reply);
  }
}

}  // namespace kurumaisu::dac
