#include "clients/calibrate/guided/coverage.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "clients/calibrate/fit/evaluate.hpp"

namespace dtact::ctl::guided {
namespace {

/// The gel's contact is narrower than the circle in which the ball cuts the undeformed surface.
constexpr double kContactOfCut = 0.97;
constexpr double kFirstOfRadius = 0.3;

std::vector<CapturedPress> contacts_of(const PressImages& images,
                                       const calibration::Calibration& empty) {
  std::vector<CapturedPress> taken;
  for (const auto& press : images.set.presses) {
    try {
      const calibration::SettledPress settled = calibration::settle(
          *empty.model, images.set.reference_q8.pixels, press.frames, images.set.ball_radius_mm);
      const calibration::Contact& contact = settled.contact;
      taken.push_back({press.name, contact.col, contact.row,
                       contact.radius_mm / empty.model->mm_per_px,
                       depth_of_width_mm(2 * contact.radius_mm, images.set.ball_radius_mm)});
    } catch (const std::runtime_error&) {
      continue;  // without contact no depth
    }
  }
  return taken;
}

}  // namespace

Coverage cover(const PressImages& images, const calibration::Calibration& empty, bool force) {
  Coverage coverage;
  if (images.set.presses.size() < 2) {
    coverage.missing = "at least two presses of different depths are needed";
  } else {
    try {
      coverage.made = std::make_shared<const calibration::Calibration>(
          build_lut(images, FitMethod::alone, &coverage.report));
      coverage.doubts = calibration::doubts_about(*coverage.made, images.set);
      if (!coverage.doubts.empty() && !force) {
        coverage.made = nullptr;
        coverage.missing = doubted(coverage.doubts);
      }
    } catch (const std::exception& e) {
      coverage.missing = e.what();
    }
  }
  coverage.presses = contacts_of(images, empty);
  if (!coverage.made) return coverage;
  // Uses fitted depths; presses that were left out do not count.
  std::erase_if(coverage.presses, [&](CapturedPress& press) {
    const auto used = std::ranges::find(coverage.report.presses, press.name,
                                        &calibration::PressReport::Depth::name);
    if (used == coverage.report.presses.end()) return true;
    press.depth_mm = used->depth_mm;
    return false;
  });
  return coverage;
}

std::string doubted(const std::vector<std::string>& doubts) {
  return fmt::format("{} (--force takes it as it is)", fmt::join(doubts, "; "));
}

double covered_mm(const calibration::Calibration& made) {
  const recon::DepthLut& lut = made.model->lut;
  return 0.001 * lut.um[static_cast<std::size_t>(lut.covered_to_q6 - lut.first_q6)];
}

double contact_width_mm(double depth_mm, double ball_radius_mm) {
  const double g = std::clamp(depth_mm, 0.0, ball_radius_mm);
  return 2 * kContactOfCut * std::sqrt(g * (2 * ball_radius_mm - g));
}

double depth_of_width_mm(double width_mm, double ball_radius_mm) {
  const double half = std::min(width_mm / 2 / kContactOfCut, ball_radius_mm);
  return ball_radius_mm - std::sqrt(ball_radius_mm * ball_radius_mm - half * half);
}

double next_depth_mm(std::vector<double> depths_mm, double ball_radius_mm) {
  if (depths_mm.empty()) return kFirstOfRadius * ball_radius_mm;
  std::ranges::sort(depths_mm);
  double below = kLightestMm;
  double widest = 0;
  double middle = kLightestMm;
  for (const double depth : depths_mm) {
    if (depth - below > widest) {
      widest = depth - below;
      middle = (below + depth) / 2;
    }
    below = std::max(below, depth);
  }
  return middle;
}

}  // namespace dtact::ctl::guided
