#pragma once

#include <string>
#include <vector>

#include "clients/calibrate/guided/capture.hpp"
#include "daemon/calibration/calibration.hpp"
#include "proto/dtact.pb.h"

namespace dtact::ctl::guided {

/// The obstacle to a calibration now, with the fix; empty when there is none.
[[nodiscard]] std::string unfit(const v1::Status& status);

/// The fault of a picture of the undeformed surface, with the fix; empty: none. `table`:
/// the map's position in its frames.
[[nodiscard]] std::string fault_of(const SteadyFrames& still, const recon::RectifyTable& table);

/// Whether the frame cannot be used, though the next may: a light change or a repeated picture.
[[nodiscard]] bool passing_trouble(const google::protobuf::RepeatedField<int>& health);

/// Camera and light of the daemon, in the calibration's terms.
[[nodiscard]] calibration::Origin origin_of(const v1::Status& status);
/// r, g, b that each LED emits: its colour after brightness and the ring's gamma.
[[nodiscard]] std::vector<std::uint8_t> leds_of(const v1::LightState& light);

/// One sentence for each difference between the sensor now and `then`, a frame of this size; empty
/// when they agree.
[[nodiscard]] std::vector<std::string> differences(const calibration::Origin& then,
                                                   const v1::Status& now, int frame_width,
                                                   int frame_height);

}  // namespace dtact::ctl::guided
