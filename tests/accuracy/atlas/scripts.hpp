#pragma once

#include <functional>
#include <memory>

#include "tests/accuracy/atlas/run.hpp"
#include "tests/accuracy/atlas/scenes.hpp"

namespace dtact::atlas {

/// Changes the shot of frame n by a disturbance's value.
using Spoil = std::function<void(Shot&, int n, double value)>;

inline constexpr int kFrames = kReady + 60;  ///< A second after the reference.
inline constexpr int kPress = kReady + 6;    ///< The first frame that shows the object.

/// No contact until kPress, then pressed. From kReady on `spoil` changes each shot.
[[nodiscard]] Script press(std::shared_ptr<const hal::sim::Truth> truth, double value,
                           const Spoil& spoil);

/// On the ball; with `rezero` the reference is taken again under the disturbance, before the press.
[[nodiscard]] std::function<Script(double)> on_ball(const Spoil& spoil, bool rezero = false);

/// On the ball, after the camera has moved and enough time has passed to detect it.
[[nodiscard]] std::function<Script(double)> after_move(const Spoil& move, bool rezero);

}  // namespace dtact::atlas
