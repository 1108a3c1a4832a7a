#pragma once

#include <array>

namespace dtact::wire {

/// HelloReply.features of dtactd and of dtact-perceive; proto/README.md says what each stands for.
inline constexpr std::array kFeatures = {"jpeg", "reconstruction", "reference"};
inline constexpr std::array kPerceiveFeatures = {"cloud", "pose", "recognition"};

}  // namespace dtact::wire
