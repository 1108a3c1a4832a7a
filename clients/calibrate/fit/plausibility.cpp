#include "clients/calibrate/fit/plausibility.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <stdexcept>

namespace dtact::calibration {
namespace {

constexpr int kLevels = 20;  // of a light press, about 0.6 mm: over these the slope is taken

double depth_um(const recon::DepthList& list, int q6) {
  const int last = static_cast<int>(list.um.size()) - 1;
  return list.um[static_cast<std::size_t>(std::clamp(q6 - list.first_q6, 0, last))];
}

/// Where a press's contact is and the mean light there; nothing where there is none.
struct LitContact {
  Contact contact;
  double light = 0;
};
std::vector<LitContact> lit_contacts(const recon::Model& model, const BallPresses& set,
                                     const image::Grey8& light) {
  std::vector<LitContact> found;
  for (const BallPresses::Press& press : set.presses) {
    try {
      const SettledPress settled =
          settle(model, set.reference_q8.pixels, press.frames, set.ball_radius_mm);
      double sum = 0;
      double pixels = 0;
      for (int y = 0, i = 0; y < light.height; ++y) {
        for (int x = 0; x < light.width; ++x, ++i) {
          if (distance_mm(settled.map, settled.contact, x, y) >= settled.contact.radius_mm)
            continue;
          sum += light.pixels[static_cast<std::size_t>(i)];
          pixels += 1;
        }
      }
      if (pixels > 0) found.push_back({settled.contact, sum / pixels});
    } catch (const std::runtime_error&) {
      continue;  // it shows no contact, and build() has said why it was left out
    }
  }
  return found;
}

}  // namespace

std::string dim_part_of(const Calibration& made, const BallPresses& set) {
  constexpr double kLeastPart = 0.005;  // of the map
  const recon::Model& model = *made.model;
  if (set.gain_told || model.gain.shape != recon::GainShape::none ||
      !model.gain.polynomial.empty()) {
    return {};
  }
  const image::Grey8 light = rectified_reference(model.rectify, set.reference_q8);
  const std::vector<LitContact> contacts = lit_contacts(model, set, light);
  if (contacts.empty()) return {};
  const double half = 0.5 * std::ranges::min(contacts, {}, &LitContact::light).light;
  double all = 0;
  double dim = 0;
  double nearest_mm = std::numeric_limits<double>::infinity();
  for (int y = 0, i = 0; y < light.height; ++y) {
    for (int x = 0; x < light.width; ++x, ++i) {
      const auto at = static_cast<std::size_t>(i);
      if (!model.untrusted.empty() && model.untrusted[at] != 0) continue;
      all += 1;
      if (light.pixels[at] >= half) continue;
      dim += 1;
      for (const LitContact& press : contacts) {
        nearest_mm = std::min(
            nearest_mm, model.mm_per_px * std::hypot(x - press.contact.col, y - press.contact.row));
      }
    }
  }
  if (dim < kLeastPart * all) return {};
  return fmt::format(
      "light: {:.0f} % of the map, from {:.1f} mm beside the ball on, has less than half of the "
      "light that the ball was pressed in; where darkening is a share of the light depth reads too "
      "shallow there, unless a board of pins says the gain (dtact-calibrate lens)",
      std::max(1.0, 100 * dim / all), nearest_mm);
}

std::vector<std::string> doubts_about(const recon::DepthList& list) {
  const int at_q6 =
      std::clamp(list.covered_to_q6, recon::kEntriesPerLevel, kLevels * recon::kEntriesPerLevel);
  const double slope = depth_um(list, at_q6) * recon::kEntriesPerLevel / at_q6;
  if (slope >= kLeastSlopeUm && slope <= kMostSlopeUm) return {};
  return {fmt::format(
      "a grey level is {:.1f} um of depth; sensors of this family have 20 to 80: check the scale "
      "(--mm-per-px, --lens) and the ball's radius (--radius-mm)",
      slope)};
}

std::vector<std::string> doubts_about(const Evaluation& press) {
  std::vector<std::string> doubts;
  const double ball = press.contact.ball_radius_mm;
  const double edge = press.contact.radius_mm;
  const double sphere_mm = ball - std::sqrt(ball * ball - edge * edge);
  if (std::abs(press.offset_mm) > kMostOffsetMm) {
    doubts.push_back(fmt::format(
        "list and sphere disagree by {:.2f} mm where healthy presses do by less than {}: check the "
        "scale (--mm-per-px, --lens), the ball's radius (--radius-mm), the place of the map "
        "(--centre, --crop), the press's depth where one was measured, that the light did not "
        "change since the reference, and that the press is no deeper than half of the ball's "
        "radius",
        press.offset_mm, kMostOffsetMm));
  }
  if (press.mae_mm > std::max(kLeastShapeMm, kMostShape * sphere_mm)) {
    doubts.push_back(fmt::format(
        "the press has not the shape of a ball: it is {:.2f} mm off a sphere of {} mm radius, "
        "{:.0f} "
        "% of its depth; check that the whole contact is lit and in the picture, the ball's radius "
        "(--radius-mm) and the scale (--mm-per-px, --lens)",
        press.mae_mm, ball, 100 * press.mae_mm / sphere_mm));
  }
  const double unseen = static_cast<double>(press.unseen) / static_cast<double>(press.pixels);
  if (unseen > kMostUnseen) {
    doubts.push_back(fmt::format(
        "{:.0f} % of the contact is too dark to be seen; press where the light is, or check the "
        "place of the map (--centre, --crop)",
        100 * unseen));
  }
  if (press.dim > kMostDim) {
    doubts.push_back(
        fmt::format("{:.0f} % of the contact and the ring about it has less than half of the light "
                    "that the rest "
                    "has; press where the light is even, nearer to the middle",
                    100 * press.dim));
  }
  return doubts;
}

std::vector<std::string> doubts_about(const Calibration& made, const BallPress& press) {
  std::vector<std::string> doubts = doubts_about(made.model->list);
  const Evaluation read =
      read_ball(made, press.reference_q8.pixels, press.frames, press.ball_radius_mm);
  std::ranges::move(doubts_about(read), std::back_inserter(doubts));
  return doubts;
}

std::vector<std::string> doubts_about(const Calibration& made, const BallPresses& set) {
  std::vector<std::string> doubts = doubts_about(made.model->list);
  for (const BallPresses::Press& press : set.presses) {
    try {
      const Evaluation read =
          read_ball(made, set.reference_q8.pixels, press.frames, set.ball_radius_mm);
      for (const std::string& doubt : doubts_about(read)) {
        doubts.push_back(fmt::format("{}: {}", press.name, doubt));
      }
    } catch (const std::runtime_error&) {
      continue;  // it shows no contact, and build() has said why it was left out
    }
  }
  return doubts;
}

}  // namespace dtact::calibration
