// SPDX-License-Identifier: BSD-3-Clause
#include "guard/server.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <ctime>
#include <utility>

#include "guard/log.h"
#include "guard/socket.h"
#include "steady.h"

namespace kurumaisu::guard {
namespace {

constexpr int kMessagesPerRound = 64;  // then the device has its turn
constexpr int kClientsPerRound = 8;
constexpr double kAcceptPause = 0.1;  // [s] after one who connected could not be taken

bool isSame(const dac::Volts& a, const dac::Volts& b) {
  return a.translation == b.translation && a.steering == b.steering && a.reference == b.reference;
}

Descriptor spare() { return Descriptor(open("/dev/null", O_RDONLY | O_CLOEXEC)); }

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

Server::Server(const Settings& settings, Device::Open open, Beat beat)
    : settings_(settings),
      beat_(std::move(beat)),
      guard_(settings.limits),
      device_(std::move(open), neutralOf(settings.limits), settings.reopening) {
  guard_.loseDevice();
  listener_ = listenAt(settings.socket);
  reserve_ = spare();
}

/// Neutral comes before anybody can ask for anything, or the news that there is no device.
void Server::begin() {
  for (double now = steadyTime(); device_.isLost() && device_.retryAt() <= now && !isTold();
       now = steadyTime()) {
    look();
    recover(now);
  }
}

void Server::run() {
  begin();
  while (!isTold()) {
    look();
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
  say("GUARD_END", "told to stop: " + signalName(told_) + reacted());
}

bool Server::isTold() {
  if (told_ == 0) told_ = signals_.nextToEnd().value_or(0);
  return told_ != 0;
}

/// Whether the sentinel lives, and whether this computer slept: then nothing that was asked for before it counts.
void Server::look() {
  guard_.watch(beat_());
  if (sleep_.hasSlept()) guard_.wake();
}

void Server::wait() {
  double until = device_.isLost() ? device_.retryAt() : written_at_ + settings_.period;
  // silence shows just after its deadline, not at it
  if (const auto deadline = guard_.deadline()) until = std::min(until, std::nextafter(*deadline, INFINITY));
  const bool accepts = accept_at_ <= steadyTime();
  if (!accepts) until = std::min(until, accept_at_);
  std::array<pollfd, 3> ready = {{{signals_.fd(), POLLIN, 0},
                                  {accepts ? listener_.get() : -1, POLLIN, 0},
                                  {client_.get(), POLLIN | POLLRDHUP, 0}}};
  const timespec timeout = timeUntil(until);
  ppoll(ready.data(), ready.size(), &timeout, nullptr);
  client_left_ = (ready[2].revents & (POLLHUP | POLLRDHUP | POLLERR)) != 0;
}

void Server::acceptClients() {
  for (int i = 0; i < kClientsPerRound; ++i) {
    Descriptor client = acceptClient();
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

/// Who connects; none if nobody does. Where no descriptor is left, the spare one serves to refuse him.
Descriptor Server::acceptClient() {
  const auto next = [this] {
    return Descriptor(accept4(listener_.get(), nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC));
  };
  if (!reserve_) reserve_ = spare();
  if (accept_at_ > steadyTime()) return Descriptor();
  Descriptor client = next();
  if (client || errno == EAGAIN) return client;
  say("GUARD_CANNOT_ACCEPT", std::strerror(errno));
  reserve_.close();
  client = next();
  accept_at_ = steadyTime() + kAcceptPause;
  return client;
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
