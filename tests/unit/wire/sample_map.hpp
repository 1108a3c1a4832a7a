#pragma once

#include <cstdint>
#include <vector>

namespace dtact::wire {

/// Two rows of four pixels whose encoded bytes were computed by hand: steps of all sizes,
/// including ones that wrap around in both directions.
inline const std::vector<std::int16_t> kMap = {0, 1, 3, -2, 1000, 1000, -32768, 7};

}  // namespace dtact::wire
