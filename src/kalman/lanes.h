// SPDX-License-Identifier: BSD-3-Clause
// Columns that go through the whitening filter several at a time.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstring>
#include <vector>

#include "kalman/whiten.h"
#include "model/wide.h"

namespace kurumaisu {

// Columns that go through a step side by side, as AVX2 has them: GCC splits more by way of the stack.
constexpr Eigen::Index kLane = 4;
struct alignas(kLane * sizeof(double)) Lane {
  double of __attribute__((vector_size(kLane * sizeof(double))));
};
using Lanes = std::vector<Lane>;

/// Filters lanes of columns by one increment: rows: three of so many lanes, in place; mean: of the state.
template <int kSize>
KURUMAISU_INLINE void filterStep(const Whitener::Step<kSize>& step, Lane* rows, std::size_t lanes,
                                 Lane* mean) {
  const auto& [l00, l10, l11, l20, l21, l22] = step.lower;
  for (std::size_t at = 0; at < lanes; ++at) {
    Lane* state = mean + kSize * at;
    Lane innovation[3];
    for (int r = 0; r < 3; ++r) {
      innovation[r] = rows[r * lanes + at];
      for (int i = 0; i < kSize; ++i) innovation[r].of -= step.seen[r][i] * state[i].of;
    }
    rows[at].of = l00 * innovation[0].of;
    rows[lanes + at].of = l10 * innovation[0].of + l11 * innovation[1].of;
    rows[2 * lanes + at].of = l20 * innovation[0].of + l21 * innovation[1].of + l22 * innovation[2].of;
    for (int i = 0; i < kSize; ++i) {
      const auto& gain = step.gain[i];
      state[i].of = step.keep[i] * state[i].of + gain[0] * innovation[0].of + gain[1] * innovation[1].of +
                    gain[2] * innovation[2].of;
    }
  }
}

/// Adds the products of all pairs of columns of some rows to the upper triangle of a gram, whose rows are lanes, too.
/// Four sums at a time stay in registers.
KURUMAISU_INLINE void addProducts(const Lane* rows, std::size_t count, std::size_t lanes, Lane* gram) {
  for (std::size_t i = 0; i < lanes * kLane; i += 4) {
    for (std::size_t at = i / kLane; at < lanes; ++at) {
      Lane a{}, b{}, c{}, d{};
      for (std::size_t r = 0; r < count; ++r) {
        const auto* left = reinterpret_cast<const double*>(rows + r * lanes) + i;
        const Lane right = rows[r * lanes + at];
        a.of += left[0] * right.of;
        b.of += left[1] * right.of;
        c.of += left[2] * right.of;
        d.of += left[3] * right.of;
      }
      Lane* sums = gram + i * lanes + at;
      sums[0].of += a.of;
      sums[lanes].of += b.of;
      sums[2 * lanes].of += c.of;
      sums[3 * lanes].of += d.of;
    }
  }
}

/// The rows of some increments, of so many columns, as lanes.
struct Block {
  Block(Eigen::Index columns, std::size_t increments)
      : lanes(static_cast<std::size_t>((columns + kLane - 1) / kLane)),
        rows(3 * increments * lanes, Lane{}) {}
  Lane* increment(std::size_t k) { return rows.data() + 3 * k * lanes; }
  /// Reads the rows (3, m) of an increment.
  void read(std::size_t k, const Eigen::Ref<const Rows>& columns, Eigen::Index row) {
    const auto bytes = static_cast<std::size_t>(columns.cols()) * sizeof(double);
    for (int r = 0; r < 3; ++r) std::memcpy(increment(k) + r * lanes, columns.row(row + r).data(), bytes);
  }

  std::size_t lanes;
  Lanes rows;
};

template <int kSize>
KURUMAISU_INLINE void whitenAll(const std::vector<Whitener::Step<kSize>>& steps,
                                const Eigen::Ref<const Rows>& columns, Rows& out) {
  const auto bytes = static_cast<std::size_t>(columns.cols()) * sizeof(double);
  Block block(columns.cols(), 1);
  Lanes mean(kSize * block.lanes, Lane{});
  Eigen::Index row = 0;
  for (const auto& step : steps) {
    block.read(0, columns, row);
    filterStep(step, block.increment(0), block.lanes, mean.data());
    for (int r = 0; r < 3; ++r)
      std::memcpy(out.row(row + r).data(), block.increment(0) + r * block.lanes, bytes);
    row += 3;
  }
}

template <int kSize>
KURUMAISU_INLINE void gramOfAll(const std::vector<Whitener::Step<kSize>>& steps,
                                const Eigen::Ref<const Rows>& columns, Rows& out) {
  constexpr std::size_t kIncrements = 8;  // at once: their rows stay in the first cache
  Block block(columns.cols(), kIncrements);
  Lanes mean(kSize * block.lanes, Lane{});
  Lanes gram(block.lanes * kLane * block.lanes, Lane{});
  std::size_t held = 0;
  Eigen::Index row = 0;
  for (const auto& step : steps) {
    block.read(held, columns, row);
    filterStep(step, block.increment(held), block.lanes, mean.data());
    row += 3;
    if (++held == kIncrements || row == columns.rows()) {
      addProducts(block.rows.data(), 3 * held, block.lanes, gram.data());
      held = 0;
    }
  }
  const auto bytes = static_cast<std::size_t>(columns.cols()) * sizeof(double);
  for (Eigen::Index i = 0; i < columns.cols(); ++i) {
    std::memcpy(out.row(i).data(), gram.data() + static_cast<std::size_t>(i) * block.lanes, bytes);
  }
}

}  // namespace kurumaisu
