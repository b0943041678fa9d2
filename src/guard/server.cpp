// SPDX-License-Identifier: BSD-3-Clause
#include "guard/server.h"

#include <poll.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <ctime>
#include <utility>

#include "guard/log.h"
#include "guard/socket.h"
#include "steady.h"

namespace kurumaisu::guard {
namespace {

constexpr int kMessagesPerRound = 64;  // then the device has its turn
constexpr int kClientsPerRound = 8;

bool isSame(const dac::Volts& a, const dac::Volts& b) {
  return a.translation == b.translation && a.steering == b.steering && a.reference == b.reference;
}

timespec timeUntil(double when) {
  const double wait = std::max(0.0, when - steadyTime());
  timespec result{};
  result.tv_sec = static_cast<time_t>(wait);
  result.tv_nsec = static_cast<long>(1e9 * (wait - static_cast<double>(result.tv_sec)));
  return result;
}

std::string peerOf(const Descriptor& client) {
  ucred peer{};
  socklen_t size = sizeof peer;
  getsockopt(client.get(), SOL_SOCKET, SO_PEERCRED, &peer, &size);
  return "process " + std::to_string(peer.pid) + " of user " + std::to_string(peer.uid);
}

}  // namespace

Server::Server(const Settings& settings, Device::Open open, std::function<void()> beat)
    : settings_(settings),
      beat_(std::move(beat)),
      guard_(settings.limits),
      device_(std::move(open), neutralOf(settings.limits), settings.reopening) {
  // neutral comes before anybody can ask for anything
  for (double now = steadyTime(); device_.isLost() && device_.retryAt() <= now; now = steadyTime())
    recover(now);
  if (device_.isLost()) guard_.loseDevice();
  listener_ = listenAt(settings.socket);
}

void Server::run() {
  while (!signals_.next()) {
    beat_();
    wait();
    noticed_ = steadyTime();
    listen();
    acceptClients();  // after a client that left: the next one may be its successor
    const double now = steadyTime();
    guard_.advance(now);
    write(now);
    answer();
    report();
  }
  drop();
  if (!device_.isLost()) put({0, 0, settings_.limits.reference}, steadyTime());
  say("GUARD_END", "told to stop" + reacted());
}

void Server::wait() {
  double until = device_.isLost() ? device_.retryAt() : written_at_ + settings_.period;
  // silence shows just after its deadline, not at it
  if (const auto deadline = guard_.deadline()) until = std::min(until, std::nextafter(*deadline, INFINITY));
  std::array<pollfd, 3> ready = {
      {{signals_.fd(), POLLIN, 0}, {listener_.get(), POLLIN, 0}, {client_.get(), POLLIN | POLLRDHUP, 0}}};
  const timespec timeout = timeUntil(until);
  ppoll(ready.data(), ready.size(), &timeout, nullptr);
  client_left_ = (ready[2].revents & (POLLHUP | POLLRDHUP | POLLERR)) != 0;
}

void Server::acceptClients() {
  for (int i = 0; i < kClientsPerRound; ++i) {
    Descriptor client(accept4(listener_.get(), nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC));
    if (!client) return;
    if (!client_) {
      say("GUARD_CLIENT", peerOf(client));
      client_ = std::move(client);
      guard_.connect();
      continue;
    }
    Reply refusal{};
    refusal.magic = kMagic;
    refusal.version = kVersion;
    refusal.state = static_cast<std::uint16_t>(guard_.state());
    refusal.reason = static_cast<std::uint16_t>(Reason::kBusy);
    refusal.time = steadyNanoseconds();
    send(client, &refusal, sizeof refusal);
    say("GUARD_BUSY", peerOf(client) + " is refused: there is a client");
  }
}

void Server::listen() {
  if (!client_) return;
  if (client_left_) return drop();
  for (int i = 0; i < kMessagesPerRound; ++i) {
    std::array<char, sizeof(Request)> bytes{};
    std::size_t size = bytes.size();
    const Heard heard = receive(client_, bytes.data(), size);
    if (heard == Heard::kGone) return drop();
    if (heard == Heard::kNothing) return;
    take(bytes.data(), size, steadyTime());
  }
}

void Server::take(const void* bytes, std::size_t size, double now) {
  const std::optional<Request> request = decode<Request>(bytes, size);
  if (request) {
    guard_.receive(*request, now);
  } else {
    guard_.receiveGarbage();
  }
  asked_ = request ? request->sequence : 0;
}

void Server::drop() {
  if (!client_) return;
  client_.close();
  client_left_ = false;
  asked_.reset();
  guard_.disconnect();
  if (guard_.state() == State::kIdle) say("GUARD_CLIENT_GONE", "neutral all the time");
}

void Server::write(double now) {
  if (device_.isLost()) {
    if (now >= device_.retryAt()) recover(now);
    return;
  }
  const dac::Volts volts = guard_.output();
  const bool is_due =
      asked_ || !written_ || !isSame(volts, *written_) || now >= written_at_ + settings_.period;
  if (is_due) put(volts, now);
}

void Server::put(const dac::Volts& volts, double now) {
  written_ = volts;
  written_at_ = now;
  const bool is_held = device_.put(volts, now);
  held_at_ = steadyTime();
  if (is_held) return;
  guard_.loseDevice();
  say("GUARD_DEVICE_FAULT", device_.problem());
}

/// Neutral is what a device gets first when it is there again.
void Server::recover(double now) {
  if (device_.recover(now)) {
    say("GUARD_DEVICE", device_.name() + ": neutral");
    guard_.findDevice();
    reported_problem_.clear();
    written_.reset();
  } else if (device_.problem() != reported_problem_) {
    reported_problem_ = device_.problem();
    say("GUARD_DEVICE_LOST", reported_problem_);
  }
}

void Server::answer() {
  if (!asked_) return;
  const dac::Volts& held = device_.held();
  const Reply reply{kMagic,
                    kVersion,
                    static_cast<std::uint16_t>(guard_.state()),
                    static_cast<std::uint16_t>(guard_.reason()),
                    static_cast<std::uint16_t>(device_.isLost() ? 0 : 1),
                    guard_.trips(),
                    *asked_,
                    steadyNanoseconds(),
                    held.translation,
                    held.steering,
                    held.reference};
  asked_.reset();
  send(client_, &reply, sizeof reply);  // who does not read his answers, has none
}

void Server::report() {
  if (guard_.state() == reported_) return;
  reported_ = guard_.state();
  if (reported_ == State::kArmed) say("GUARD_ARMED", "neutral was held");
  if (reported_ == State::kTripped) {
    say("GUARD_TRIPPED",
        nameOf(guard_.reason()) + ": neutral, until the client holds neutral again" + reacted());
  }
}

std::string Server::reacted() const {
  return device_.isLost() ? "; the device is lost" : reaction(noticed_, held_at_);
}

}  // namespace kurumaisu::guard
