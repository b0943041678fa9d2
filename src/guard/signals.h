// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <initializer_list>
#include <optional>

#include "file_descriptor.h"

namespace kurumaisu::guard {

/// Signals that wait to be read in place of interrupting; signalfd(2).
class Signals {
 public:
  explicit Signals(std::initializer_list<int> numbers);

  int fd() const { return descriptor_.get(); }

  /// The next that came; none if there is none.
  std::optional<int> next() const;

 private:
  Descriptor descriptor_;
};

}  // namespace kurumaisu::guard
