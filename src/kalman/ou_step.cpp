// SPDX-License-Identifier: BSD-3-Clause
#include "kalman/ou_step.h"

#include <cmath>

namespace kurumaisu {

OuStep ouStep(double dt, double tau) {
  const double x = dt / tau;
  const double decay = std::exp(-x);
  const double lost = -std::expm1(-x);
  // For small x the closed form cancels to nothing; its series does not.
  const double spread =
      x < 1e-2 ? 2.0 / 3.0 * x * x * x - 0.5 * x * x * x * x : 2.0 * x - 4.0 * lost - std::expm1(-2.0 * x);
  const double late = x < 1e-2 ? x * x * (x / 24.0 - 1.0 / 12.0) : (lost - x * decay) / x - 0.5 * lost;
  const double lateness =
      x < 1e-2 ? x * x * x * (1.0 / 60.0 - x / 144.0) : 2.0 * (x / 12.0 + (0.5 + 1.0 / x) * late);
  return {decay,
          tau * lost,
          tau * late,
          -std::expm1(-2.0 * x),
          tau * tau * spread,
          tau * tau * (lateness - late * late),
          tau * lost * lost,
          -tau * late * (1.0 + decay),
          -tau * tau * late * lost};
}

}  // namespace kurumaisu
