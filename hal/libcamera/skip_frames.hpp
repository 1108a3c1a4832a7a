#pragma once

#include <cstdint>
#include <functional>

#include "hal/live/source.hpp"

namespace dtact::hal::libcamera_backend {

/// Takes `frames` frames from `source` and hands each back at once. False when the stream ended or
/// was silent until `deadline_ns` (CLOCK_MONOTONIC), or as soon as `worth_it`, asked after each
/// frame, says no.
[[nodiscard]] bool skip_frames(live::Source& source, int frames, std::int64_t deadline_ns,
                               const std::function<bool()>& worth_it);

}  // namespace dtact::hal::libcamera_backend
