// SPDX-License-Identifier: BSD-3-Clause
#include "laser/link.h"

#include <algorithm>
#include <array>
#include <utility>

#include "scip/scan.h"

namespace kurumaisu::laser {
namespace {

constexpr double kSlice = 0.05;          // [s] between two looks whether to go on
constexpr double kSendTimeout = 0.2;     // [s] for a few bytes, at any rate
constexpr std::size_t kChunk = 1 << 14;  // [bytes] more than a scan

}  // namespace

Link::Link(std::unique_ptr<Port> port, Now now, Interrupted interrupted)
    : port_(std::move(port)),
      now_(std::move(now)),
      interrupted_(std::move(interrupted)),
      last_byte_(steadyTime()),
      last_arrival_(now_()) {}

void Link::send(const std::string& command) {
  assembler_.expect(command);
  port_->write(command + "\n", kSendTimeout);
}

void Link::receive(double timeout) {
  if (interrupted_()) throw LinkLost("LASER_INTERRUPTED: told to stop");
  std::array<char, kChunk> bytes;
  const std::size_t count = port_->read(bytes.data(), bytes.size(), std::clamp(timeout, 0.0, kSlice));
  if (count == 0) return;
  last_arrival_ = now_();
  last_byte_ = steadyTime();
  assembler_.add({bytes.data(), count}, last_arrival_);
}

std::optional<scip::Message> Link::next(double timeout) {
  for (const double until = steadyTime() + timeout;;) {
    if (std::optional<scip::Message> message = assembler_.next()) return message;
    const double left = until - steadyTime();
    if (left <= 0) return std::nullopt;
    receive(left);
  }
}

std::optional<scip::Message> Link::ask(const std::string& command, double timeout, double busy) {
  send(command);
  const double start = steadyTime();
  double until = start + timeout;
  while (steadyTime() < until) {
    std::optional<scip::Message> message = next(std::min(until - steadyTime(), kSlice));
    if (message && message->command == command && message->status != "99") return message;
    if (last_byte_ > start) until = std::clamp(last_byte_ + timeout, until, start + std::max(timeout, busy));
  }
  return std::nullopt;
}

scip::Message Link::ask(const std::string& command, double timeout) {
  if (std::optional<scip::Message> message = ask(command, timeout, timeout)) return *message;
  throw NoAnswer("LASER_NO_ANSWER: no answer to " + command + " in " + std::to_string(timeout) + " s");
}

void Link::setBaud(int baud) {
  port_->setBaud(baud);
  assembler_.clear();
}

}  // namespace kurumaisu::laser
