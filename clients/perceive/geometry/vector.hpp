#pragma once

#include <array>

namespace dtact::perceive {

/// A point or direction of the surface frame.
using Vector = std::array<double, 3>;

}  // namespace dtact::perceive
