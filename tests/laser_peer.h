// SPDX-License-Identifier: BSD-3-Clause
// A sensor of a few lines at the other end of a pty or a socket, for tests of the link.
#pragma once

#include <fcntl.h>
#include <poll.h>
#include <pty.h>
#include <termios.h>
#include <unistd.h>

#include <atomic>
#include <functional>
#include <mutex>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "laser/port.h"
#include "scip/code.h"

namespace kurumaisu::test {

constexpr int kBaud = 115200;

/// What waits where a test should not: fails instead of hanging.
inline double seconds(const std::function<void()>& action) {
  const double start = laser::steadyTime();
  action();
  return laser::steadyTime() - start;
}

inline std::string problem(const std::function<void()>& action) {
  try {
    action();
  } catch (const std::exception& error) {
    return error.what();
  }
  return "nothing";
}

bool has(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

inline std::string summed(const std::string& line) { return line + scip::sum(line) + "\n"; }

inline std::string keyed(const std::string& line) { return line + ";" + scip::sum(line) + "\n"; }

/// Echo, status, lines as they are, and the end.
inline std::string reply(const std::string& command, const std::string& status,
                         const std::string& lines = "") {
  return command + "\n" + status + (status.size() == 2 ? std::string(1, scip::sum(status)) : "") + "\n" +
         lines + "\n";
}

/// A pty; this end is the sensor's.
class Pty {
 public:
  Pty() {
    int slave = -1;
    if (openpty(&master_, &slave, path_, nullptr, nullptr) != 0) throw std::runtime_error("no pty");
    termios raw{};
    tcgetattr(slave, &raw);
    cfmakeraw(&raw);
    tcsetattr(slave, TCSANOW, &raw);
    close(slave);
  }
  ~Pty() { hangUp(); }
  Pty(const Pty&) = delete;
  Pty& operator=(const Pty&) = delete;

  void hangUp() {
    if (master_ >= 0) close(master_);
    master_ = -1;
  }

  int fd() const { return master_; }
  std::string path() const { return path_; }

  /// The rate that the other end has set.
  speed_t speed() const {
    termios mode{};
    tcgetattr(master_, &mode);
    return cfgetospeed(&mode);
  }

 private:
  int master_ = -1;
  char path_[64] = {};
};

/// Answers lines that come to a descriptor, in a thread of its own.
class Peer {
 public:
  using Answer = std::function<std::string(const std::string& command)>;

  Peer(int fd, Answer answer) : fd_(fd), answer_(std::move(answer)), thread_([this] { run(); }) {}
  ~Peer() {
    stop_ = true;
    thread_.join();
  }
  Peer(const Peer&) = delete;
  Peer& operator=(const Peer&) = delete;

  void say(const std::string& bytes) {
    if (write(fd_, bytes.data(), bytes.size()) < 0) throw std::runtime_error("peer cannot write");
  }

  /// Commands heard so far.
  std::vector<std::string> heard() const {
    const std::lock_guard<std::mutex> guard(mutex_);
    return heard_;
  }

 private:
  void run() {
    std::string line;
    while (!stop_) {
      pollfd waiting{fd_, POLLIN, 0};
      if (poll(&waiting, 1, 5) <= 0) continue;
      char byte = 0;
      if (read(fd_, &byte, 1) != 1) {
        usleep(1000);  // nobody has opened the other end
        continue;
      }
      if (byte != '\n') {
        line += byte;
        continue;
      }
      {
        const std::lock_guard<std::mutex> guard(mutex_);
        heard_.push_back(line);
      }
      const std::string said = answer_(line);
      line.clear();
      if (!said.empty()) say(said);
    }
  }

  const int fd_;
  const Answer answer_;
  mutable std::mutex mutex_;
  std::vector<std::string> heard_;
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

}  // namespace kurumaisu::test
