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

constexpr Eigen::Index kLane = 8;  // columns that go through a step side by side
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

/// Adds the products of all pairs of columns of three rows to the upper triangle of a gram, whose rows are lanes, too.
KURUMAISU_INLINE void addProducts(const Lane* rows, std::size_t lanes, Eigen::Index columns, Lane* gram) {
  for (Eigen::Index i = 0; i < columns; ++i) {
    const std::size_t own = static_cast<std::size_t>(i / kLane);
    const double a = rows[own].of[i % kLane];
    const double b = rows[lanes + own].of[i % kLane];
    const double c = rows[2 * lanes + own].of[i % kLane];
    Lane* sums = gram + static_cast<std::size_t>(i) * lanes;
    for (std::size_t at = own; at < lanes; ++at) {
      sums[at].of += a * rows[at].of + b * rows[lanes + at].of + c * rows[2 * lanes + at].of;
    }
  }
}

/// Three rows of columns (3 n, m), and as many lanes of them.
struct Triple {
  explicit Triple(Eigen::Index columns)
      : lanes(static_cast<std::size_t>((columns + kLane - 1) / kLane)), rows(3 * lanes, Lane{}) {}
  double* row(int r) { return reinterpret_cast<double*>(rows.data() + r * lanes); }

  std::size_t lanes;
  Lanes rows;
};

template <int kSize>
KURUMAISU_INLINE void whitenAll(const std::vector<Whitener::Step<kSize>>& steps,
                                const Eigen::Ref<const Rows>& columns, Rows& out) {
  const auto bytes = static_cast<std::size_t>(columns.cols()) * sizeof(double);
  Triple some(columns.cols());
  Lanes mean(kSize * some.lanes, Lane{});
  Eigen::Index row = 0;
  for (const auto& step : steps) {
    for (int r = 0; r < 3; ++r) std::memcpy(some.row(r), columns.row(row + r).data(), bytes);
    filterStep(step, some.rows.data(), some.lanes, mean.data());
    for (int r = 0; r < 3; ++r) std::memcpy(out.row(row + r).data(), some.row(r), bytes);
    row += 3;
  }
}

template <int kSize>
KURUMAISU_INLINE void gramOfAll(const std::vector<Whitener::Step<kSize>>& steps,
                                const Eigen::Ref<const Rows>& columns, Rows& out) {
  const Eigen::Index m = columns.cols();
  const auto bytes = static_cast<std::size_t>(m) * sizeof(double);
  Triple some(m);
  Lanes mean(kSize * some.lanes, Lane{});
  Lanes gram(static_cast<std::size_t>(m) * some.lanes, Lane{});
  Eigen::Index row = 0;
  for (const auto& step : steps) {
    for (int r = 0; r < 3; ++r) std::memcpy(some.row(r), columns.row(row + r).data(), bytes);
    filterStep(step, some.rows.data(), some.lanes, mean.data());
    addProducts(some.rows.data(), some.lanes, m, gram.data());
    row += 3;
  }
  for (Eigen::Index i = 0; i < m; ++i) std::memcpy(out.row(i).data(), gram.data() + i * some.lanes, bytes);
}

}  // namespace kurumaisu
