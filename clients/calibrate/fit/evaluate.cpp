#include "clients/calibrate/fit/evaluate.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <numbers>
#include <stdexcept>
#include <vector>

#include "clients/calibrate/fit/build.hpp"
#include "clients/calibrate/fit/darkening_map.hpp"
#include "clients/calibrate/fit/lut_fit.hpp"

namespace dtact::calibration {
namespace {

constexpr int kHalves = 8;  // directions of the cut, 45 degrees apart

/// Median, the offset that minimises the mean absolute error, and the distances from it.
struct Spread {
  double offset = 0;
  double mean = 0;
  double median = 0;
  double within = 0;  ///< 95 % of them.
};

Spread spread_of(std::vector<double> errors) {
  if (errors.empty()) return {};
  const auto middle = errors.begin() + static_cast<std::ptrdiff_t>(errors.size() / 2);
  std::ranges::nth_element(errors, middle);
  Spread spread{.offset = *middle};
  for (double& error : errors) {
    error = std::abs(error - spread.offset);
    spread.mean += error;
  }
  spread.mean /= static_cast<double>(errors.size());
  std::ranges::sort(errors);
  spread.median = errors[errors.size() / 2];
  spread.within = errors[errors.size() * 95 / 100];
  return spread;
}

/// Calls `visit(x, y, sphere_mm)` for each pixel in the contact.
template <typename Visit>
void for_contact(const DarkeningMap& map, const Contact& contact, const Visit& visit) {
  const double r2 = contact.ball_radius_mm * contact.ball_radius_mm;
  const double edge = std::sqrt(r2 - contact.radius_mm * contact.radius_mm);
  for (int y = 0; y < map.height; ++y) {
    for (int x = 0; x < map.width; ++x) {
      const double r = distance_mm(map, contact, x, y);
      if (r < contact.radius_mm) visit(x, y, std::sqrt(r2 - r * r) - edge);
    }
  }
}

/// Error of a LUT made from the pixels `fitted` on the others.
double left_out_error(const SymmetricPress& press, const PixelFilter& fitted) {
  const recon::DepthLut lut = fit_lut(press.map, press.contact, fitted);
  std::vector<double> errors;
  for_contact(press.map, press.contact, [&](int x, int y, double sphere) {
    const double level = press.map.at(x, y);
    if (fitted(x, y) || std::isnan(level)) return;
    errors.push_back(lut_mm(lut, level) - sphere);
  });
  return spread_of(std::move(errors)).mean;
}

double half_error(const SymmetricPress& press, double angle) {
  const double dx = std::cos(angle);
  const double dy = std::sin(angle);
  return left_out_error(press, [&](int x, int y) {
    return (x - press.contact.col) * dx + (y - press.contact.row) * dy > 0;
  });
}

/// Error of the even sectors with a LUT from the odd ones, or the reverse.
double sector_error(const SettledPress& press, double turned, bool even) {
  constexpr double kSector = 45;  // degrees; half as wide for choosing the gain
  const Contact& contact = press.contact;
  const PixelFilter fitted = [&](int x, int y) {
    return in_even_sector(x - contact.col, y - contact.row, kSector, turned) == even;
  };
  const ChosenAsymmetry chosen = choose_asymmetry(sure_samples(press.map, contact, fitted),
                                                  contact.ball_radius_mm, kSector / 2);
  return left_out_error(without_asymmetry(press.map, contact, chosen.gain), fitted);
}

void leave_out(const SettledPress& press, Evaluation& result) {
  const Contact& contact = press.contact;
  result.press_asymmetry =
      choose_asymmetry(sure_samples(press.map, contact), contact.ball_radius_mm);
  const SymmetricPress level = without_asymmetry(press.map, contact, result.press_asymmetry.gain);
  double sum = 0;
  double worst = 0;
  for (int i = 0; i < kHalves; ++i) {
    const double error = half_error(level, i * 2 * std::numbers::pi / kHalves);
    sum += error;
    worst = std::max(worst, error);
  }
  result.half_mae_mm = sum / kHalves;
  result.half_worst_mm = worst;
  double sectors = 0;
  for (const double turned : {0.0, 22.5}) {
    for (const bool even : {true, false}) sectors += sector_error(press, turned, even);
  }
  result.sector_mae_mm = sectors / 4;
}

/// Computes Evaluation::dim.
double dim_share(const recon::Model& model, const SettledPress& press) {
  constexpr double kWithRing = 1.5;  // contact radii
  const image::Grey8 light = rectified_reference(
      model.rectify, {model.rectify.frame_width, model.rectify.frame_height, press.reference_q8});
  std::vector<std::uint8_t> levels;
  for (int y = 0, i = 0; y < light.height; ++y) {
    for (int x = 0; x < light.width; ++x, ++i) {
      const auto at = static_cast<std::size_t>(i);
      if (distance_mm(press.map, press.contact, x, y) >= kWithRing * press.contact.radius_mm ||
          (!model.untrusted.empty() && model.untrusted[at] != 0)) {
        continue;
      }
      levels.push_back(light.pixels[at]);
    }
  }
  if (levels.empty()) return 1;
  const auto middle = levels.begin() + static_cast<std::ptrdiff_t>(levels.size() / 2);
  std::ranges::nth_element(levels, middle);
  const int half = *middle / 2;
  return static_cast<double>(std::ranges::count_if(levels, [half](int v) { return v < half; })) /
         static_cast<double>(levels.size());
}

Evaluation read(const recon::Model& model, const SettledPress& press,
                std::span<const image::Grey8> frames) {
  Evaluation result;
  result.contact = press.contact;
  result.drift_levels = press.drift_levels;
  result.dim = dim_share(model, press);

  DarkeningMap depth{press.map.width, press.map.height, press.map.mm_per_px,
                     mean_depth_um(model, press.reference_q8, frames)};
  if (model.surface.view.per_mm > 0) {
    depth = in_true_places(depth, model.surface.view, [](double um) { return 0.001 * um; });
  }
  std::vector<double> errors;
  for_contact(press.map, press.contact, [&](int x, int y, double sphere) {
    ++result.pixels;
    const double um = depth.at(x, y);
    result.unseen += static_cast<std::size_t>(std::isnan(press.map.at(x, y)));
    if (std::isnan(um)) {
      ++result.untrusted;
    } else {
      errors.push_back(0.001 * um - sphere);
    }
  });
  for (const double error : errors) result.raw_mae_mm += std::abs(error);
  result.raw_mae_mm /= std::max<double>(1, static_cast<double>(errors.size()));
  const Spread spread = spread_of(std::move(errors));
  result.offset_mm = spread.offset;
  result.mae_mm = spread.mean;
  result.median_mm = spread.median;
  result.within_mm = spread.within;
  return result;
}

/// A usable press's contact and the mean light there.
struct LitContact {
  Contact contact;
  double light = 0;
};
std::vector<LitContact> lit_contacts(const recon::Model& model, const BallPresses& set,
                                     const image::Grey8& light) {
  std::vector<LitContact> found;
  const UsablePresses usable = settle_each(model, set);  // build() has named those left out
  for (const SettledPress& press : usable.presses) {
    double sum = 0;
    double pixels = 0;
    for (int y = 0, i = 0; y < light.height; ++y) {
      for (int x = 0; x < light.width; ++x, ++i) {
        if (distance_mm(press.map, press.contact, x, y) >= press.contact.radius_mm) continue;
        sum += light.pixels[static_cast<std::size_t>(i)];
        pixels += 1;
      }
    }
    if (pixels > 0) found.push_back({press.contact, sum / pixels});
  }
  return found;
}

}  // namespace

Evaluation read_ball(const Calibration& calibration, std::span<const std::uint16_t> reference_q8,
                     std::span<const image::Grey8> frames, double ball_radius_mm) {
  const recon::Model& model = *calibration.model;
  return read(model, settle(model, reference_q8, frames, ball_radius_mm), frames);
}

Evaluation evaluate(const Calibration& calibration, std::span<const std::uint16_t> reference_q8,
                    std::span<const image::Grey8> frames, double ball_radius_mm) {
  const recon::Model& model = *calibration.model;
  const SettledPress press = settle(model, reference_q8, frames, ball_radius_mm);
  Evaluation result = read(model, press, frames);
  if (model.method == recon::Method::lut) leave_out(press, result);
  return result;
}

std::string dim_part_of(const Calibration& made, const BallPresses& set) {
  constexpr double kMinPart = 0.005;  // of the map
  const recon::Model& model = *made.model;
  if (set.gain_specified || model.gain.shape != recon::GainShape::none ||
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
  if (dim < kMinPart * all) return {};
  return fmt::format(
      "light: {:.0f} % of the map, from {:.1f} mm beside the ball on, has less than half of the "
      "light that the ball was pressed in; where darkening is a share of the light depth reads too "
      "shallow there, unless a board of pins says the gain (dtact-calibrate lens)",
      std::max(1.0, 100 * dim / all), nearest_mm);
}

std::vector<std::string> doubts_about(const recon::DepthLut& lut) {
  const double slope = 1000 * slope_mm(lut);
  if (slope >= kMinSlopeUm && slope <= kMaxSlopeUm) return {};
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
  if (std::abs(press.offset_mm) > kMaxOffsetMm) {
    doubts.push_back(fmt::format(
        "LUT and sphere disagree by {:.2f} mm where healthy presses do by less than {}: check the "
        "scale (--mm-per-px, --lens), the ball's radius (--radius-mm), the place of the map "
        "(--centre, --crop), the press's depth where one was measured, that the light did not "
        "change since the reference, and that the press is no deeper than half of the ball's "
        "radius",
        press.offset_mm, kMaxOffsetMm));
  }
  if (press.mae_mm > std::max(kMinShapeMm, kMaxShape * sphere_mm)) {
    doubts.push_back(fmt::format(
        "the press has not the shape of a ball: it is {:.2f} mm off a sphere of {} mm radius, "
        "{:.0f} "
        "% of its depth; check that the whole contact is lit and in the picture, the ball's radius "
        "(--radius-mm) and the scale (--mm-per-px, --lens)",
        press.mae_mm, ball, 100 * press.mae_mm / sphere_mm));
  }
  const double unseen = static_cast<double>(press.unseen) / static_cast<double>(press.pixels);
  if (unseen > kMaxUnseen) {
    doubts.push_back(fmt::format(
        "{:.0f} % of the contact is too dark to be seen; press where the light is, or check the "
        "place of the map (--centre, --crop)",
        100 * unseen));
  }
  if (press.dim > kMaxDim) {
    doubts.push_back(
        fmt::format("{:.0f} % of the contact and the ring about it has less than half of the light "
                    "that the rest "
                    "has; press where the light is even, nearer to the middle",
                    100 * press.dim));
  }
  return doubts;
}

std::vector<std::string> doubts_about(const Calibration& made, const BallPress& press) {
  std::vector<std::string> doubts = doubts_about(made.model->lut);
  const Evaluation read =
      read_ball(made, press.reference_q8.pixels, press.frames, press.ball_radius_mm);
  std::ranges::move(doubts_about(read), std::back_inserter(doubts));
  return doubts;
}

std::vector<std::string> doubts_about(const Calibration& made, const BallPresses& set) {
  std::vector<std::string> doubts = doubts_about(made.model->lut);
  const UsablePresses usable = settle_each(*made.model, set);  // build() has named those left out
  for (std::size_t i = 0; i < usable.presses.size(); ++i) {
    const BallPresses::Press& press = set.presses[usable.indices[i]];
    for (const std::string& doubt :
         doubts_about(read(*made.model, usable.presses[i], press.frames))) {
      doubts.push_back(fmt::format("{}: {}", press.name, doubt));
    }
  }
  return doubts;
}

}  // namespace dtact::calibration
