// SPDX-License-Identifier: BSD-3-Clause
#include "slam/localization/combed.h"

#include <algorithm>

namespace kurumaisu {

Combed::Combed(const Field& field, int stride, int reach)
    : field_(&field),
      stride_(stride),
      margin_((reach + stride - 1) / stride * stride),
      teeth_((field.width() + 2 * margin_ + stride - 1) / stride),
      far_(static_cast<std::size_t>(teeth_) * stride, Field::kFar),
      rows_(field.height()) {}

const std::uint8_t* Combed::at(int x, int y) {
  const int shifted = x + margin_;
  const std::ptrdiff_t place = static_cast<std::ptrdiff_t>(shifted % stride_) * teeth_ + shifted / stride_;
  if (y < 0 || y >= field_->height()) return far_.data() + place;
  Row& row = rows_[y];
  if (row.empty()) row = combed(y);
  return row.data() + place;
}

void Combed::forgetBelow(int y) {
  for (; forgotten_ < std::min(y, field_->height()); ++forgotten_) Row().swap(rows_[forgotten_]);
}

Combed::Row Combed::combed(int y) const {
  Row out = far_;
  const std::uint8_t* codes = field_->row(y);
  for (int remainder = 0; remainder < stride_; ++remainder) {
    std::uint8_t* tooth = &out[static_cast<std::size_t>(remainder) * teeth_ + margin_ / stride_];
    for (int x = remainder; x < field_->width(); x += stride_) *tooth++ = codes[x];
  }
  return out;
}

}  // namespace kurumaisu
