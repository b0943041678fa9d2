// SPDX-License-Identifier: BSD-3-Clause
#include "guard/log.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <csignal>
#include <cstdio>

namespace kurumaisu::guard {
namespace {

constexpr std::size_t kLongest = 1024;  // [bytes] of a line: a pipe takes it whole or not at all
constexpr int kLastLines = 200;         // [ms] for the writer at the end

std::size_t dropped = 0;  // lines

struct Pipe {
  Descriptor read;
  Descriptor write;
};

Pipe makePipe() {
  std::array<int, 2> ends{};
  checked(pipe2(ends.data(), O_CLOEXEC), "pipe");
  return {Descriptor(ends[0]), Descriptor(ends[1])};
}

bool writeLine(std::string line) {
  if (line.size() >= kLongest) line.resize(kLongest - 1);
  line += '\n';
  return write(STDERR_FILENO, line.data(), line.size()) == static_cast<ssize_t>(line.size());
}

/// What cannot be written, to a terminal that is gone for example, is left out.
void copy(int from, int to) {
  std::array<char, 4096> bytes{};
  for (;;) {
    const ssize_t count = read(from, bytes.data(), bytes.size());
    if (count <= 0) return;
    for (ssize_t done = 0; done < count;) {
      const ssize_t written = write(to, bytes.data() + done, static_cast<std::size_t>(count - done));
      if (written <= 0) break;
      done += written;
    }
  }
}

/// In the process of its own.
[[noreturn]] void serve(Pipe lines, Pipe done) {
  sigset_t all;
  sigfillset(&all);
  sigprocmask(SIG_BLOCK, &all, nullptr);
  setsid();
  lines.write.close();
  done.read.close();
  close(STDIN_FILENO);
  close(STDOUT_FILENO);
  copy(lines.read.get(), STDERR_FILENO);
  _exit(0);
}

}  // namespace

LogWriter::LogWriter() {
  Pipe lines = makePipe();
  Pipe done = makePipe();
  const pid_t between = checked(fork(), "fork");
  if (between == 0) {  // its child is nobody's child: whoever waits for children does not meet it
    if (fork() == 0) serve(std::move(lines), std::move(done));
    _exit(0);
  }
  waitpid(between, nullptr, 0);
  checked(fcntl(lines.write.get(), F_SETFL, O_NONBLOCK), "pipe");
  checked(dup2(lines.write.get(), STDERR_FILENO), "stderr");
  std::signal(SIGPIPE, SIG_IGN);  // the writer may be killed
  done_ = std::move(done.read);
}

LogWriter::~LogWriter() {
  const Descriptor nothing(::open("/dev/null", O_WRONLY | O_CLOEXEC));
  if (nothing) dup2(nothing.get(), STDERR_FILENO);
  pollfd ready{done_.get(), 0, 0};
  poll(&ready, 1, kLastLines);
}

void say(const std::string& code, const std::string& text) {
  if (dropped > 0 &&
      writeLine("GUARD_LOG_DROPPED: " + std::to_string(dropped) + " lines: nobody reads this log")) {
    dropped = 0;
  }
  if (!writeLine(code + ": " + text)) ++dropped;
}

std::string reaction(double noticed, double neutral) {
  std::array<char, 80> text{};
  std::snprintf(text.data(), text.size(), "; noticed at %.6f s, neutral %.3f ms later", noticed,
                1e3 * (neutral - noticed));
  return text.data();
}

}  // namespace kurumaisu::guard
