#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "proto/dtact.pb.h"

namespace dtact::force {

/// Objects for the calibration, each pressed with loads from light to heavy near the middle.
enum class Calibrating : std::uint8_t {
  ball,              ///< A ball of 4 mm radius, 11 loads.
  ball_and_flat_end  ///< The ball, and a disc of 2 mm radius, 5 loads.
};

/// One press of an object that was not used in the calibration, and the force that a client got.
struct HeldOut {
  std::string object;
  double thickness_mm = 0;  ///< Gel thickness.
  double depth_mm = 0;
  double true_n = 0;
  bool valid = false;
  double force_n = 0;
  double uncertainty_n = 0;
  v1::ForceAbsence absence = v1::FORCE_ABSENCE_NONE;
  bool in_contact = false;
};

struct Trial {
  std::string calibration;  ///< Last output of dtact-calibrate force.
  std::vector<HeldOut> presses;
};

/// Calibrates depth and force of the simulated sensor, whose gel has this thickness, with
/// dtact-calibrate from PNG files of its camera in `folder`. Then presses `count` objects of kinds,
/// sizes, places, rotations, tilts and depths drawn by `seed`, through camera, capture loop and
/// frame encoder.
[[nodiscard]] Trial try_held_out(double thickness_mm, Calibrating calibrating, std::uint64_t seed,
                                 int count, const std::filesystem::path& folder,
                                 int sharpen_steps = 0);

/// True error over stated error.
[[nodiscard]] double ratio(const HeldOut& press);

/// The value below which `share` of the values are.
[[nodiscard]] double quantile(std::vector<double> values, double share);

}  // namespace dtact::force
