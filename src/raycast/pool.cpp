// SPDX-License-Identifier: BSD-3-Clause
#include "raycast/pool.h"

#include <unistd.h>

#include <algorithm>

namespace kurumaisu {

Pool::Pool(int threads) : owner_(getpid()) {
  for (int i = 1; i < threads; ++i) threads_.emplace_back(&Pool::wait, this);
}

Pool::~Pool() {
  if (getpid() != owner_) {
    for (std::thread& thread : threads_) thread.detach();  // they run in the process that made them
    return;
  }
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    stop_ = true;
  }
  wake_.notify_all();
  for (std::thread& thread : threads_) thread.join();
}

void Pool::run(std::size_t count, const std::function<void(std::size_t, std::size_t)>& work) {
  if (threads_.empty() || count < 2 || getpid() != owner_) {
    if (count > 0) work(0, count);
    return;
  }
  constexpr std::size_t kPartsPerThread = 8;  // scans differ in cost; the last part should be short
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    work_ = &work;
    count_ = count;
    part_ = std::max<std::size_t>(1, count / (kPartsPerThread * (threads_.size() + 1)));
    next_ = 0;
    ++round_;
  }
  wake_.notify_all();
  takeParts(work);
  std::unique_lock<std::mutex> lock(mutex_);
  work_ = nullptr;  // whoever has slept through it need not be waited for
  done_.wait(lock, [this] { return busy_ == 0; });
}

void Pool::wait() {
  std::size_t seen = 0;
  while (true) {
    const std::function<void(std::size_t, std::size_t)>* work = nullptr;
    {
      std::unique_lock<std::mutex> lock(mutex_);
      wake_.wait(lock, [&] { return stop_ || round_ != seen; });
      if (stop_) return;
      seen = round_;
      if (work_ == nullptr) continue;
      work = work_;
      ++busy_;
    }
    takeParts(*work);
    const std::lock_guard<std::mutex> lock(mutex_);
    if (--busy_ == 0) done_.notify_one();
  }
}

void Pool::takeParts(const std::function<void(std::size_t, std::size_t)>& work) {
  while (true) {
    const std::size_t begin = next_.fetch_add(part_);
    if (begin >= count_) return;
    work(begin, std::min(begin + part_, count_));
  }
}

}  // namespace kurumaisu
