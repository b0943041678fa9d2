// SPDX-License-Identifier: BSD-3-Clause
#include "plausible/quantity.h"

#include <sstream>
#include <stdexcept>

namespace kurumaisu {

void require(const Quantity& quantity, const std::string& what, double value) {
  if (value >= quantity.least && value <= quantity.most) return;
  std::ostringstream text;
  text << what << ": must be a number from " << quantity.least << " to " << quantity.most << " "
       << quantity.unit << ": " << value;
  throw std::invalid_argument(text.str());
}

const Quantity& quantityOf(const std::string& name) {
  for (const Quantity& each : plausible::kAll) {
    if (name == each.name) return each;
  }
  throw std::invalid_argument("there is no quantity " + name);
}

std::string frameOf(const std::string& name) {
  const std::size_t start = name.find_first_not_of('/');
  return start == std::string::npos ? "" : name.substr(start);
}

}  // namespace kurumaisu
