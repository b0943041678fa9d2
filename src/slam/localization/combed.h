// SPDX-License-Identifier: BSD-3-Clause
// A field's codes in the order in which a search asks for them.
#pragma once

#include <cstdint>
#include <vector>

#include "slam/localization/field.h"

namespace kurumaisu {

/// Rows of codes, combed: those a stride apart lie side by side, so that all places of a row are tried in one sweep. Rows
/// are combed when they are asked for first. Beyond the edges of the map all is far.
class Combed {
 public:
  /// Keeps a reference to the field. stride, and how far outside of the grid may be asked for: [cells].
  Combed(const Field& field, int stride, int reach);

  /// Codes at x, x + stride, x + 2 stride ... of row y, up to width - 1 + reach; x from -reach on.
  const std::uint8_t* at(int x, int y);

  /// Rows below y will not be asked for again.
  void forgetBelow(int y);

 private:
  using Row = std::vector<std::uint8_t>;
  Row combed(int y) const;

  const Field* field_;
  int stride_, margin_, teeth_;  ///< codes of a row with equal remainder
  int forgotten_ = 0;            ///< rows below
  Row far_;
  std::vector<Row> rows_;
};

}  // namespace kurumaisu
