// SPDX-License-Identifier: BSD-3-Clause
#include "guard/client.h"

#include <poll.h>

#include <array>
#include <cmath>
#include <ctime>
#include <utility>

#include "guard/crash.h"
#include "guard/socket.h"
#include "steady.h"

namespace kurumaisu::guard {
namespace {

void waitFor(const Descriptor& socket, double seconds_left) {
  timespec wait{};
  wait.tv_sec = static_cast<time_t>(seconds_left);
  wait.tv_nsec = static_cast<long>(1e9 * (seconds_left - static_cast<double>(wait.tv_sec)));
  pollfd ready{socket.get(), POLLIN, 0};
  ppoll(&ready, 1, &wait, nullptr);
}

}  // namespace

Client::Client(ClientSettings settings) : settings_(std::move(settings)) {}

const Status& Client::exchange(Kind kind, const dac::Volts& volts) {
  const std::int64_t begin = steadyNanoseconds();
  if (!socket_ && !connect(seconds(begin))) return status_;
  hear(seconds(begin));  // answers that came too late for the last call
  const Request request{kMagic,
                        kVersion,
                        static_cast<std::uint16_t>(kind),
                        ++sequence_,
                        steadyNanoseconds(),
                        volts.translation,
                        volts.steering,
                        volts.reference};
  if (socket_ && send(socket_, &request, sizeof request) == Sent::kGone) lose(seconds(begin));
  for (;;) {
    const double left = seconds(begin) + settings_.reply_wait - steadyTime();
    if (!socket_ || answered_ == sequence_) return status_;
    if (left <= 0) break;
    waitFor(socket_, left);
    hear(steadyTime());
  }
  ++status_.late;
  return status_;
}

bool Client::connect(double now) {
  if (now < retry_at_) return false;
  socket_ = connectTo(settings_.socket);
  if (!socket_) {
    lose(now);
    return false;
  }
  const std::uint64_t late = status_.late;
  const std::uint64_t connections = status_.connections + 1;
  hangUpOnCrash(socket_.get());
  status_ = Status();
  status_.late = late;
  status_.connections = connections;
  status_.connected = true;
  return true;
}

/// Without a guard its sentinel writes neutral; nobody knows more.
void Client::lose(double now) {
  hangUpOnCrash(-1);
  socket_.close();
  retry_at_ = now + settings_.retry_pause;
  status_.connected = false;
  status_.has_device = false;
  status_.volts.translation = status_.volts.steering = 0;
  if (status_.reason != Reason::kBusy) {
    status_.state = State::kIdle;
    status_.reason = Reason::kNone;
  }
}

bool Client::hear(double now) {
  while (socket_) {
    std::array<char, sizeof(Reply)> bytes{};
    std::size_t size = bytes.size();
    const Heard heard = receive(socket_, bytes.data(), size);
    if (heard == Heard::kNothing) return true;
    const auto reply = heard == Heard::kMessage ? decode<Reply>(bytes.data(), size) : std::nullopt;
    if (!reply || reply->version != kVersion) {
      lose(now);
    } else {
      note(*reply);
    }
  }
  return false;
}

void Client::note(const Reply& reply) {
  answered_ = reply.sequence;
  status_.state = stateOf(reply.state).value_or(State::kTripped);
  status_.reason = reasonOf(reply.reason).value_or(Reason::kNone);
  status_.has_device = reply.device != 0;
  status_.volts = {reply.translation, reply.steering, reply.reference};
  status_.trips = reply.trips;
  status_.answered = seconds(reply.time);
}

}  // namespace kurumaisu::guard
