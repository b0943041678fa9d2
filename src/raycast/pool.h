// SPDX-License-Identifier: BSD-3-Clause
// A few threads that wait for work.
#pragma once

#include <sys/types.h>

#include <atomic>
#include <condition_variable>
#include <cstddef>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

namespace kurumaisu {

/// Splits a range of numbers among threads that are made once and sleep in between.
class Pool {
 public:
  /// The caller's thread is one of them: 1 makes none.
  explicit Pool(int threads);
  ~Pool();
  Pool(const Pool&) = delete;
  Pool& operator=(const Pool&) = delete;

  /// Calls work(begin, end) for parts of [0, count) until all is done. work must not throw.
  ///
  /// In a forked process, which has none of the threads, the caller does it all.
  void run(std::size_t count, const std::function<void(std::size_t, std::size_t)>& work);

 private:
  void wait();
  void takeParts(const std::function<void(std::size_t, std::size_t)>& work);

  pid_t owner_;
  std::vector<std::thread> threads_;
  std::mutex mutex_;
  std::condition_variable wake_, done_;
  const std::function<void(std::size_t, std::size_t)>* work_ = nullptr;  ///< null: nothing to do
  std::size_t count_ = 0;
  std::size_t part_ = 1;
  std::atomic<std::size_t> next_{0};
  std::size_t round_ = 0;  ///< of work; a thread that has not seen it takes part
  std::size_t busy_ = 0;   ///< threads at work, without the caller's
  bool stop_ = false;
};

}  // namespace kurumaisu
