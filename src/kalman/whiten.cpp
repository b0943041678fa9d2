// SPDX-License-Identifier: BSD-3-Clause
#include "kalman/whiten.h"

#include <array>
#include <cmath>
#include <cstring>
#include <stdexcept>
#include <string>
#include <vector>

#include "kalman/ou_step.h"
#include "model/wide.h"

namespace kurumaisu {
namespace {

using Matrix3 = Eigen::Matrix3d;

/// Partial derivatives of one body increment by its two end poses, by the integrated rate errors and by their lateness,
/// and by such errors that act on this increment alone.
struct Jacobians {
  Matrix3 from, to, motion, late, rolling;
};

using Way = Eigen::Matrix<double, 1, Track::Ways::ColsAtCompileTime>;

Jacobians jacobians(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Way& way) {
  const double c = std::cos(a.z());
  const double s = std::sin(a.z());
  const Eigen::Vector3d world = b - a;
  Jacobians j;
  j.to << c, s, 0, -s, c, 0, 0, 0, 1;
  j.from = -j.to;
  j.from(0, 2) = -s * world.x() + c * world.y();
  j.from(1, 2) = -c * world.x() - s * world.y();
  // An error of a speed acts along the heading, and one of the yaw rate swings the rest of the way. Without the late
  // ones, a reference better than that would make noise of the motion pass for an effect.
  j.motion << way[0], -way[1], -way[3], way[1], way[0], way[2], 0, 0, 1;
  j.late << way[4], -way[5], -way[7], way[5], way[4], way[6], 0, 0, 0;
  return j;
}

void checkFactors(const char* name, const Eigen::VectorXd& factors, Eigen::Index n) {
  if (factors.size() != n || !(factors.array() >= 0).all()) {
    throw std::invalid_argument(std::string(name) + " must have one factor per increment, none negative");
  }
}

void check(const Track& track, const MotionNoise& noise) {
  const auto& [poses, times, activity, rolling, ways] = track;
  const Eigen::Index n = poses.rows() - 1;
  if (n < 1 || poses.cols() != 3) throw std::invalid_argument("poses must have shape (n + 1, 3), n > 0");
  if (times.size() != n + 1) throw std::invalid_argument("times and poses must have the same length");
  if (!((times.tail(n) - times.head(n)).array() > 0).all()) {
    throw std::invalid_argument("times must increase");
  }
  checkFactors("activity", activity, n);
  checkFactors("rolling", rolling, n);
  if (ways.rows() != n || !ways.allFinite()) {
    throw std::invalid_argument("ways must have one finite row per increment");
  }
  if (!(noise.position_sd > 0 && noise.heading_sd > 0 && noise.fast.tau > 0 && noise.slow.tau > 0) ||
      !(noise.fast.sd.array() > 0).all() || !(noise.slow.sd.array() >= 0).all()) {
    throw std::invalid_argument("every noise parameter must be positive");
  }
  if (!(noise.lasting >= 0 && noise.lasting < 1 && noise.lasting_tau > 0)) {
    throw std::invalid_argument("lasting must be a share below 1, and lasting_tau positive");
  }
}

/// What a step needs of the processes.
template <int kColours>
struct Processes {
  explicit Processes(const MotionNoise& noise)
      : colours{noise.fast, noise.slow}, lasting_tau(noise.lasting_tau) {
    for (int c = 0; c < kColours; ++c) {
      for (int i = 0; i < 3; ++i) variance[3 * c + i] = colours[c].sd[i] * colours[c].sd[i];
    }
  }

  /// Works them out for a time step, unless it is the last one again but for its rounding: many increments are alike.
  void advance(double next) {
    if (std::abs(next - dt) <= kRounding * next) return;
    dt = next;
    for (int c = 0; c < kColours; ++c) steps[c] = ouStep(dt, colours[c].tau);
    lasting_keep = std::exp(-dt / lasting_tau);
  }

  static constexpr double kRounding = 1e-12;
  std::array<Colour, 2> colours;
  std::array<double, std::size_t{3} * kColours> variance;
  double lasting_tau;
  double dt = 0.0;
  double lasting_keep = 0.0;  // share of a lasting error that is there a step later
  std::array<OuStep, kColours> steps{};
};

/// The filter's covariance, step by step. Rows are a little longer than needed, for the machine takes some at once.
/// Its state: white errors of the pose, errors of the rates, and errors of the pose that last, if any.
template <int kColours, bool kLasting>
class Covariance {
 public:
  static constexpr int kRates = 3, kLong = 3 + 3 * kColours, kSize = kLong + (kLasting ? 3 : 0);

  explicit Covariance(const MotionNoise& noise) : processes_(noise) {
    const double sd[] = {noise.position_sd, noise.position_sd, noise.heading_sd};
    for (int i = 0; i < 3; ++i) {
      white_[i] = (1 - noise.lasting) * sd[i] * sd[i];
      long_[i] = noise.lasting * sd[i] * sd[i];
      cov_[i][i] = white_[i];
      if constexpr (kLasting) cov_[kLong + i][kLong + i] = long_[i];
    }
    for (int i = kRates; i < kLong; ++i) cov_[i][i] = processes_.variance[i - kRates];
  }

  /// Goes on by an increment of dt [s], and tells what that does to any column, and its log variances. Returns false
  /// where its covariance is singular.
  KURUMAISU_INLINE bool advance(const Jacobians& j, double dt, Whitener::Step<kSize>& step, double* logs) {
    processes_.advance(dt);
    for (int i = 0; i < 3; ++i) {
      fresh_[i] = kLasting ? (1 - processes_.lasting_keep * processes_.lasting_keep) * long_[i] : 0.0;
    }
    see(j, step);
    double root[3][3];
    if (!cholesky(step, j, root)) return false;
    for (int r = 0; r < 3; ++r) logs[r] = 2.0 * std::log(root[r][r]);
    const double l00 = 1.0 / root[0][0], l11 = 1.0 / root[1][1], l22 = 1.0 / root[2][2];
    const double l10 = -root[1][0] * l00 * l11;
    const double l21 = -root[2][1] * l11 * l22;
    const double l20 = -(root[2][0] * l00 + root[2][1] * l10) * l22;
    step.lower = {l00, l10, l11, l20, l21, l22};
    cross(j, step);
    for (int i = 0; i < kSize; ++i) {  // gained: the root of what the increment tells of the state
      const double a = cross_[0][i], b = cross_[1][i], c = cross_[2][i];
      gained_[0][i] = l00 * a;
      gained_[1][i] = l10 * a + l11 * b;
      gained_[2][i] = l20 * a + l21 * b + l22 * c;
      step.gain[i] = {l00 * gained_[0][i] + l10 * gained_[1][i] + l20 * gained_[2][i],
                      l11 * gained_[1][i] + l21 * gained_[2][i], l22 * gained_[2][i]};
    }
    update(step);
    return true;
  }

 private:
  static constexpr int kRow = (kSize + 3) / 4 * 4;

  /// State to increment, and its covariance with the increment.
  KURUMAISU_INLINE void see(const Jacobians& j, Whitener::Step<kSize>& step) {
    for (int r = 0; r < 3; ++r) {
      for (int i = 0; i < 3; ++i) {
        step.seen[r][i] = j.from(r, i);
        for (int c = 0; c < kColours; ++c) {
          const OuStep& ou = processes_.steps[c];
          step.seen[r][kRates + 3 * c + i] = ou.reach * j.motion(r, i) + ou.late * j.late(r, i);
        }
        if constexpr (kLasting) step.seen[r][kLong + i] = j.from(r, i) + processes_.lasting_keep * j.to(r, i);
      }
      for (int i = 0; i < kRow; ++i) seen_[r][i] = 0.0;
      for (int k = 0; k < kSize; ++k) {
        const double by = step.seen[r][k];
        for (int i = 0; i < kRow; ++i) seen_[r][i] += by * cov_[k][i];
      }
    }
  }

  /// The root of the increment's covariance.
  KURUMAISU_INLINE bool cholesky(const Whitener::Step<kSize>& step, const Jacobians& j,
                                 double (&root)[3][3]) const {
    double spread[3] = {}, late[3] = {}, both[3] = {};  // of the rates' own noise during the increment
    double whole[3] = {};                               // spread of noise that begins with it
    for (int c = 0; c < kColours; ++c) {
      const OuStep& ou = processes_.steps[c];
      for (int i = 0; i < 3; ++i) {
        const double variance = processes_.variance[3 * c + i];
        spread[i] += ou.var_integral * variance;
        late[i] += ou.var_late * variance;
        both[i] += ou.cov_both * variance;
        whole[i] += (ou.var_integral + ou.reach * ou.reach) * variance;
      }
    }
    for (int r = 0; r < 3; ++r) {
      for (int s = 0; s <= r; ++s) {
        double sum = 0.0;
        for (int i = 0; i < kSize; ++i) sum += step.seen[r][i] * seen_[s][i];
        for (int i = 0; i < 3; ++i) {
          sum += (white_[i] + fresh_[i]) * j.to(r, i) * j.to(s, i) +
                 spread[i] * j.motion(r, i) * j.motion(s, i) + late[i] * j.late(r, i) * j.late(s, i) +
                 both[i] * (j.motion(r, i) * j.late(s, i) + j.late(r, i) * j.motion(s, i)) +
                 whole[i] * j.rolling(r, i) * j.rolling(s, i);
        }
        for (int k = 0; k < s; ++k) sum -= root[r][k] * root[s][k];
        if (r == s && sum <= 0) return false;
        root[r][s] = r == s ? std::sqrt(sum) : sum / root[s][s];
      }
    }
    return true;
  }

  /// Covariance of the next state with this increment: e anew, u decayed, and the noise that both have in common.
  KURUMAISU_INLINE void cross(const Jacobians& j, Whitener::Step<kSize>& step) {
    for (int i = 0; i < 3; ++i) step.keep[i] = 0.0;
    for (int r = 0; r < 3; ++r) {
      for (int i = 0; i < 3; ++i) {
        cross_[r][i] = white_[i] * j.to(r, i);
        if constexpr (kLasting) {
          step.keep[kLong + i] = processes_.lasting_keep;
          cross_[r][kLong + i] = processes_.lasting_keep * seen_[r][kLong + i] + fresh_[i] * j.to(r, i);
        }
      }
      for (int c = 0; c < kColours; ++c) {
        const OuStep& ou = processes_.steps[c];
        for (int axis = 0; axis < 3; ++axis) {
          const int i = kRates + 3 * c + axis;
          step.keep[i] = ou.decay;
          cross_[r][i] =
              ou.decay * seen_[r][i] +
              processes_.variance[i - kRates] * (ou.cov * j.motion(r, axis) + ou.cov_late * j.late(r, axis));
        }
      }
    }
  }

  /// Covariance of the next state, given this increment.
  KURUMAISU_INLINE void update(const Whitener::Step<kSize>& step) {
    double keep[kRow] = {};
    for (int i = 0; i < kSize; ++i) keep[i] = step.keep[i];
    for (int k = 0; k < kSize; ++k) {
      const double a = gained_[0][k], b = gained_[1][k], c = gained_[2][k], own = keep[k];
      for (int i = 0; i < kRow; ++i) {
        cov_[k][i] = own * keep[i] * cov_[k][i] - (a * gained_[0][i] + b * gained_[1][i] + c * gained_[2][i]);
      }
    }
    for (int i = 0; i < 3; ++i) {
      cov_[i][i] += white_[i];
      if constexpr (kLasting) cov_[kLong + i][kLong + i] += fresh_[i];
    }
    for (int i = kRates; i < kLong; ++i) {
      cov_[i][i] += processes_.steps[(i - kRates) / 3].var_u * processes_.variance[i - kRates];
    }
  }

  alignas(64) double cov_[kSize][kRow] = {};
  alignas(64) double seen_[3][kRow] = {};
  alignas(64) double cross_[3][kRow] = {};
  alignas(64) double gained_[3][kRow] = {};
  double white_[3], long_[3];  // variances of the reference's errors
  double fresh_[3] = {};       // of what is new in those that last
  Processes<kColours> processes_;
};

template <int kColours, bool kLasting>
KURUMAISU_INLINE auto filterAll(const Track& track, const MotionNoise& noise,
                                Eigen::MatrixX3d& log_determinants) {
  const auto& [poses, times, activity, rolling, ways] = track;
  Covariance<kColours, kLasting> covariance(noise);
  std::vector<Whitener::Step<decltype(covariance)::kSize>> steps(static_cast<std::size_t>(poses.rows() - 1));
  for (std::size_t k = 0; k < steps.size(); ++k) {
    const auto at = static_cast<Eigen::Index>(k);
    Jacobians j = jacobians(poses.row(at).transpose(), poses.row(at + 1).transpose(), ways.row(at));
    j.rolling = rolling[at] * j.motion;
    j.motion *= activity[at];
    j.late *= activity[at];
    double logs[3];
    if (!covariance.advance(j, times[at + 1] - times[at], steps[k], logs)) {
      throw std::invalid_argument("the increments' covariance is singular");
    }
    log_determinants.row(at) << logs[0], logs[1], logs[2];
  }
  return steps;
}

KURUMAISU_WIDE std::vector<Whitener::Step<6>> filterOne(const Track& track, const MotionNoise& noise,
                                                        Eigen::MatrixX3d& log_determinants) {
  return filterAll<1, false>(track, noise, log_determinants);
}

KURUMAISU_WIDE std::vector<Whitener::Step<9>> filterTwo(const Track& track, const MotionNoise& noise,
                                                        Eigen::MatrixX3d& log_determinants) {
  return filterAll<2, false>(track, noise, log_determinants);
}

KURUMAISU_WIDE std::vector<Whitener::Step<9>> filterOneLasting(const Track& track, const MotionNoise& noise,
                                                               Eigen::MatrixX3d& log_determinants) {
  return filterAll<1, true>(track, noise, log_determinants);
}

KURUMAISU_WIDE std::vector<Whitener::Step<12>> filterTwoLasting(const Track& track, const MotionNoise& noise,
                                                                Eigen::MatrixX3d& log_determinants) {
  return filterAll<2, true>(track, noise, log_determinants);
}

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

KURUMAISU_WIDE void whitenSteps(const std::vector<Whitener::Step<6>>& steps,
                                const Eigen::Ref<const Rows>& columns, Rows& out) {
  whitenAll(steps, columns, out);
}

KURUMAISU_WIDE void whitenSteps(const std::vector<Whitener::Step<9>>& steps,
                                const Eigen::Ref<const Rows>& columns, Rows& out) {
  whitenAll(steps, columns, out);
}

KURUMAISU_WIDE void whitenSteps(const std::vector<Whitener::Step<12>>& steps,
                                const Eigen::Ref<const Rows>& columns, Rows& out) {
  whitenAll(steps, columns, out);
}

KURUMAISU_WIDE void gramOfSteps(const std::vector<Whitener::Step<6>>& steps,
                                const Eigen::Ref<const Rows>& columns, Rows& out) {
  gramOfAll(steps, columns, out);
}

KURUMAISU_WIDE void gramOfSteps(const std::vector<Whitener::Step<9>>& steps,
                                const Eigen::Ref<const Rows>& columns, Rows& out) {
  gramOfAll(steps, columns, out);
}

KURUMAISU_WIDE void gramOfSteps(const std::vector<Whitener::Step<12>>& steps,
                                const Eigen::Ref<const Rows>& columns, Rows& out) {
  gramOfAll(steps, columns, out);
}

}  // namespace

Whitener::Whitener(const Track& track, const MotionNoise& noise) {
  check(track, noise);
  log_determinants_.resize(track.poses.rows() - 1, 3);
  const bool two = (noise.slow.sd.array() > 0).any();
  if (noise.lasting > 0) {
    if (two) {
      steps_ = filterTwoLasting(track, noise, log_determinants_);
    } else {
      steps_ = filterOneLasting(track, noise, log_determinants_);
    }
  } else if (two) {
    steps_ = filterTwo(track, noise, log_determinants_);
  } else {
    steps_ = filterOne(track, noise, log_determinants_);
  }
}

void Whitener::requireRows(const Eigen::Ref<const Rows>& columns) const {
  if (columns.rows() != 3 * log_determinants_.rows()) {
    throw std::invalid_argument("columns must have three rows per increment");
  }
}

Rows Whitener::whiten(const Eigen::Ref<const Rows>& columns) const {
  requireRows(columns);
  Rows out(columns.rows(), columns.cols());
  std::visit([&](const auto& steps) { whitenSteps(steps, columns, out); }, steps_);
  return out;
}

Rows Whitener::gram(const Eigen::Ref<const Rows>& columns) const {
  requireRows(columns);
  Rows out(columns.cols(), columns.cols());
  std::visit([&](const auto& steps) { gramOfSteps(steps, columns, out); }, steps_);
  return out.selfadjointView<Eigen::Upper>();
}

}  // namespace kurumaisu
