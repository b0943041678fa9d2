// SPDX-License-Identifier: BSD-3-Clause
// Preloaded into a program (LD_PRELOAD), it makes system calls go wrong: for scripts/bench base_faults.
// BROKEN_CALLS names a file of a struct Control, which may be changed while the program runs.
#include <fcntl.h>
#include <pthread.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <sys/time.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdint>
#include <cstdlib>
#include <ctime>

namespace {

constexpr std::int64_t kSecond = 1000000000;  // [ns]
constexpr std::int64_t kSlice =
    2000000;  // [ns] after which who sleeps by the wall clock looks whether it was set

enum Writes : std::int32_t {
  kWhole = 0,
  kHalf = 1,   ///< of each write to a tty half is taken; the rest when it comes again
  kStuck = 2,  ///< half of the first one, then EAGAIN, though poll() says that there is room
  kError = 3,  ///< EIO
};

struct Control {
  volatile std::int64_t step;   ///< [ns] by which the wall clock was set
  volatile std::int32_t write;  ///< Writes
  volatile std::int32_t count;  ///< of writes that were broken
};

Control* openControl() {
  const char* const file = std::getenv("BROKEN_CALLS");
  if (file == nullptr) std::abort();
  const int fd = open(file, O_RDWR | O_CLOEXEC);
  void* const memory = mmap(nullptr, sizeof(Control), PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0);
  if (fd < 0 || memory == MAP_FAILED) std::abort();
  close(fd);
  return static_cast<Control*>(memory);
}

Control& control() {
  static Control* const shared = openControl();
  return *shared;
}

std::int64_t nanoseconds(const timespec& time) { return kSecond * time.tv_sec + time.tv_nsec; }

timespec timeOf(std::int64_t ns) { return {ns / kSecond, ns % kSecond}; }

std::int64_t kernelTime(clockid_t clock) {
  timespec now{};
  syscall(SYS_clock_gettime, clock, &now);
  return nanoseconds(now);
}

std::int64_t wallTime() { return kernelTime(CLOCK_REALTIME) + control().step; }

bool isMonotonic(const pthread_cond_t* condition) {
  return (condition->__data.__wrefs & 2U) != 0;  // where glibc keeps the clock of pthread_condattr_setclock()
}

ssize_t kernelWrite(int fd, const void* bytes, std::size_t size) {
  return syscall(SYS_write, fd, bytes, size);
}

}  // namespace

extern "C" {

int clock_gettime(clockid_t clock, timespec* time) noexcept {
  const long result = syscall(SYS_clock_gettime, clock, time);
  if (result == 0 && (clock == CLOCK_REALTIME || clock == CLOCK_REALTIME_COARSE)) {
    *time = timeOf(nanoseconds(*time) + control().step);
  }
  return static_cast<int>(result);
}

int gettimeofday(timeval* time, void* /*zone*/) noexcept {
  const std::int64_t now = wallTime();
  *time = {now / kSecond, now % kSecond / 1000};
  return 0;
}

std::time_t time(std::time_t* result) noexcept {
  const std::time_t now = wallTime() / kSecond;
  if (result != nullptr) *result = now;
  return now;
}

int pthread_cond_timedwait(pthread_cond_t* condition, pthread_mutex_t* mutex, const timespec* until) {
  if (isMonotonic(condition)) return pthread_cond_clockwait(condition, mutex, CLOCK_MONOTONIC, until);
  for (;;) {
    const std::int64_t left = nanoseconds(*until) - wallTime();
    const timespec next = timeOf(kernelTime(CLOCK_MONOTONIC) + std::clamp<std::int64_t>(left, 0, kSlice));
    const int result = pthread_cond_clockwait(condition, mutex, CLOCK_MONOTONIC, &next);
    if (result != ETIMEDOUT || wallTime() >= nanoseconds(*until)) return result;
  }
}

ssize_t write(int fd, const void* bytes, std::size_t size) {
  static bool begun = false;  // the half before kStuck
  const int how = control().write;
  if (how != kStuck) begun = false;
  if (how == kWhole || isatty(fd) == 0) return kernelWrite(fd, bytes, size);
  ++control().count;
  if (how == kHalf || !begun) {
    begun = how == kStuck;
    if (how != kError) return kernelWrite(fd, bytes, std::max<std::size_t>(size / 2, 1));
  }
  errno = how == kError ? EIO : EAGAIN;
  return -1;
}

}  // extern "C"
