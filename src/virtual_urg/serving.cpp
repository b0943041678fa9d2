// SPDX-License-Identifier: BSD-3-Clause
// What a Server's thread does.
#include <poll.h>
#include <pthread.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <csignal>
#include <ctime>
#include <utility>

#include "steady.h"
#include "virtual_urg/server.h"
#include "virtual_urg/uart.h"

namespace kurumaisu::virtual_urg {
namespace {

/// Waits so long [s] for one of the descriptors.
template <std::size_t N>
void pollFor(std::array<pollfd, N>& descriptors, double seconds) {
  timespec timeout{};
  if (std::isfinite(seconds)) {
    seconds = std::max(seconds, 0.0);
    timeout.tv_sec = static_cast<std::time_t>(seconds);
    timeout.tv_nsec = static_cast<long>(1e9 * (seconds - std::floor(seconds)));
  }
  ppoll(descriptors.data(), N, std::isfinite(seconds) ? &timeout : nullptr, nullptr);
}

}  // namespace

void Server::run() {
  sigset_t all;
  sigfillset(&all);
  pthread_sigmask(SIG_BLOCK, &all, nullptr);  // they are for the program, not for this thread
  try {
    serve();
  } catch (...) {
    const std::lock_guard lock(mutex_);
    failure_ = std::current_exception();
  }
  room_.notify_all();
}

void Server::serve() {
  std::unique_lock lock(mutex_);
  while (!stopping_) {
    const double now = steadyTime();
    if (now >= back_at_) {
      back_at_ = Outbox::kNever;
      endpoint_->plug();
    }
    if (options_.pace == Pace::kReal) turn(now);
    flush(now);
    const double until = wakeAt(now);
    const bool reads = !endpoint_->connected() || outbox_.takesReply();
    const short events = static_cast<short>((reads ? POLLIN : 0) | (full_ ? POLLOUT : 0));
    std::array<pollfd, 2> polled{pollfd{wake_.descriptor(), POLLIN, 0},
                                 pollfd{endpoint_->descriptor(), events, 0}};
    lock.unlock();
    pollFor(polled, until - steadyTime());
    lock.lock();
    wake_.clear();
    if ((polled[1].revents & POLLOUT) != 0) full_ = false;
    if ((polled[1].revents & ~POLLOUT) != 0 && !stopping_) heed();
  }
}

double Server::wakeAt(double now) {
  double until = back_at_;
  if (!full_ && endpoint_->connected()) until = std::min(until, outbox_.next());
  if (options_.pace == Pace::kReal && device_.wantsScan()) {
    until = std::min(until, turn_start_ + device_.readyAfter());
  }
  return std::max(until, now);
}

void Server::turn(double now) {
  const double due = turn_start_ + device_.readyAfter();
  if (now < due) return;
  // A turn that is over is not made up for: its scan would come late, and the next with it.
  const double behind = std::floor((now - due) / device_.scanTime());
  turn_start_ += behind * device_.scanTime();
  if (device_.wantsScan()) {
    counters_.late += static_cast<std::uint64_t>(behind);
    shown_.start = turn_start_;
    post(device_.measure(shown_, now), device_.baud(), true);
  }
  turn_start_ += device_.scanTime();
}

void Server::begin(double now) {
  // The laser comes on in the middle of a turn, so the next one is the first that it measures.
  const double turns = std::ceil((now - turn_start_) / device_.scanTime());
  turn_start_ += std::max(turns, 0.0) * device_.scanTime();
}

void Server::heed() {
  if (!endpoint_->connected()) {
    if (!endpoint_->accept()) return;
    ++counters_.clients;
    post(device_.connect(deviceTime()), device_.baud(), false);
    return;
  }
  std::optional<std::string> bytes = endpoint_->read();
  if (!bytes) return gone();
  if (bytes->empty()) return;
  counters_.bytes_in += bytes->size();
  const int baud = device_.baud();
  const int rate = endpoint_->rate();
  if (device_.hasStrictBaud() && baud > 0 && rate > 0 && rate != baud) {
    counters_.garbled += bytes->size();
    bytes = received(*bytes, rate, baud);
  }
  const bool wanted = device_.wantsScan();
  post(device_.receive(*bytes, deviceTime()), baud, false);
  if (!wanted && device_.wantsScan()) begin(steadyTime());
}

void Server::flush(double now) {
  while (endpoint_->connected() && !outbox_.empty() && !full_) {
    const std::string_view bytes = outbox_.due(now);
    if (!bytes.empty()) {
      const std::optional<std::size_t> taken = send(bytes);
      if (!taken) return gone();
      outbox_.sent(*taken);
      full_ = *taken < bytes.size();
    }
    const std::optional<Output> output = outbox_.finished();
    if (!output) break;
    apply(*output);
  }
  if (outbox_.empty()) makeRoom();
}

void Server::makeRoom() {
  patient_ = true;
  room_.notify_all();
}

std::optional<std::size_t> Server::send(std::string_view bytes) {
  const int baud = outbox_.baud();
  const int rate = endpoint_->rate();
  if (!device_.hasStrictBaud() || baud <= 0 || rate <= 0 || rate == baud) {
    const std::optional<std::size_t> taken = endpoint_->write(bytes);
    counters_.bytes_out += taken.value_or(0);
    return taken;
  }
  // What the system does not take of it is lost: it is of no use anyway.
  const std::optional<std::size_t> taken = endpoint_->write(received(bytes, baud, rate));
  if (!taken) return std::nullopt;
  counters_.bytes_out += *taken;
  counters_.garbled += bytes.size();
  return bytes.size();
}

bool Server::post(Output output, int baud, bool is_scan) {
  if (output.bytes.empty() && output.event == Event::kNone) return true;
  if (!endpoint_->connected()) {
    if (is_scan) ++counters_.unheard;
    apply(output);
    return true;
  }
  if (is_scan && !outbox_.takesScan()) {
    ++counters_.dropped;
    return false;
  }
  if (options_.line_rate && baud > 0) {
    output.spread = std::max(output.spread, kBitsOfByte * static_cast<double>(output.bytes.size()) / baud);
  }
  outbox_.add(std::move(output), baud, is_scan);
  return true;
}

void Server::apply(const Output& output) {
  switch (output.event) {
    case Event::kNone:
      return;
    case Event::kClose:
      endpoint_->close();
      break;
    case Event::kReset:
      endpoint_->reset();
      break;
    case Event::kHangUp:
      endpoint_->unplug();
      back_at_ = steadyTime() + output.away;
      break;
  }
  gone();
}

void Server::gone() {
  outbox_.clear();
  full_ = false;
  if (endpoint_->tellsLeaving()) device_.disconnect(deviceTime());
  makeRoom();
}

}  // namespace kurumaisu::virtual_urg
