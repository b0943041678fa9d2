// SPDX-License-Identifier: BSD-3-Clause
// A D/A converter in memory that processes share: what was put out, when and by whom, outlives whoever is killed.
#pragma once

#include <sys/mman.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <memory>
#include <new>
#include <stdexcept>
#include <string>

#include "dac/converter.h"
#include "steady.h"

namespace guarding {

namespace d = kurumaisu::dac;

struct Written {
  double time;  ///< [s, monotonic]
  pid_t by;
  d::Volts volts;
};

/// The board itself. It holds its last voltages, whoever dies.
struct Board {
  static constexpr std::size_t kMost = 100'000;
  std::atomic<std::size_t> count{0};
  std::atomic<bool> broken{false};     ///< does not answer
  std::atomic<bool> unplugged{false};  ///< cannot be opened either
  std::atomic<double> offset{0};       ///< [V] of the reference
  std::atomic<double> residue{0};      ///< [V] that neutral has
  std::array<Written, kMost> written;

  const Written& last() const { return written[count - 1]; }
};

/// Memory for a board, shared with children.
class SharedBoard {
 public:
  SharedBoard() {
    void* memory = mmap(nullptr, sizeof(Board), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    if (memory == MAP_FAILED) throw std::bad_alloc();
    board_ = new (memory) Board;
  }
  SharedBoard(const SharedBoard&) = delete;
  SharedBoard& operator=(const SharedBoard&) = delete;
  ~SharedBoard() { munmap(board_, sizeof(Board)); }

  Board* operator->() const { return board_; }

  /// What opens it, as a guard wants it.
  auto opener() const {
    return [board = board_] { return std::make_unique<Opened>(*board); };
  }

 private:
  class Opened : public d::Converter {
   public:
    explicit Opened(Board& board) : board_(board) { open(); }

    d::Volts put(const d::Volts& volts) override {
      if (board_.broken || board_.unplugged) throw d::Fault("the board: no answer");
      board_.written.at(board_.count) = {kurumaisu::steadyTime(), getpid(), volts};
      ++board_.count;
      return {volts.translation + board_.residue, volts.steering, volts.reference + board_.offset};
    }
    void reopen() override { open(); }
    std::string name() const override { return "the board"; }

   private:
    void open() {
      if (board_.unplugged) throw d::Fault("the board: not there");
    }

    Board& board_;
  };

  Board* board_;
};

}  // namespace guarding
