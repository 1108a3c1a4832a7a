#include "clients/calibrate/fit/build.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <stdexcept>

#include "clients/calibrate/fit/lut_fit.hpp"
#include "clients/calibrate/fit/lut_uncertainty.hpp"
#include "clients/calibrate/fit/published.hpp"
#include "daemon/calibration/calibration.hpp"

namespace dtact::calibration {
namespace {

/// Share of the contact that may be black or white before the press is refused.
constexpr double kClipped = 0.01;
constexpr double kLeans = 0.004;         // per mm; an even press has a plane of 0.001
constexpr double kLeftByTheLight = 0.5;  // share of the plane

/// An image on the depth map's grid: for each of its pixels the nearest of the frame.
template <typename Pixel>
image::Grey8 rectified(const recon::RectifyTable& table, const Pixel& pixel) {
  image::Grey8 part{table.width, table.height, {}};
  for (const recon::RectifyTable::Entry& e : table.entries) {
    const int x = e.x + (e.fx + 64) / 128;
    const int y = e.y + (e.fy + 64) / 128;
    part.pixels.push_back(
        pixel(static_cast<std::size_t>(y) * static_cast<std::size_t>(table.frame_width) +
              static_cast<std::size_t>(x)));
  }
  return part;
}

void refuse_clipped(const image::Grey8& part, const Contact& contact, double mm_per_px,
                    std::uint8_t limit, const char* message) {
  std::size_t all = 0;
  std::size_t clipped = 0;
  for (int y = 0; y < part.height; ++y) {
    for (int x = 0; x < part.width; ++x) {
      if (std::hypot(x - contact.col, y - contact.row) * mm_per_px >= contact.radius_mm) continue;
      ++all;
      clipped += static_cast<std::size_t>(
          part.pixels[static_cast<std::size_t>(y) * static_cast<std::size_t>(part.width) +
                      static_cast<std::size_t>(x)] == limit);
    }
  }
  if (static_cast<double>(clipped) > kClipped * static_cast<double>(all)) {
    throw std::runtime_error(message);
  }
}

/// The part of the lens's rectified image that the frame shows; without a lens the frame.
Crop seen(const std::optional<recon::Lens>& lens, int width, int height, double mm_per_px) {
  if (!lens) return {0, 0, width, height};
  std::vector<std::uint8_t> outside;
  (void)map_table(lens, width, height, {0, 0, width, height, mm_per_px}, outside);
  int left = width;
  int right = 0;
  int top = height;
  int bottom = 0;
  for (int y = 0, i = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x, ++i) {
      if (outside[static_cast<std::size_t>(i)] != 0) continue;
      left = std::min(left, x);
      right = std::max(right, x);
      top = std::min(top, y);
      bottom = std::max(bottom, y);
    }
  }
  return {left, top, right - left + 1, bottom - top + 1};
}

/// Size of the press's own plane, per mm.
double lean_of(const SettledPress& press) {
  const PressAsymmetry gain = fit_asymmetry(sure_samples(press.map, press.contact),
                                            press.contact.ball_radius_mm, AsymmetryOrder::plane);
  return std::hypot(gain.factors[0], gain.factors[1]);
}

ChosenAsymmetry press_asymmetry_of(const SettledPress& press) {
  return choose_asymmetry(sure_samples(press.map, press.contact), press.contact.ball_radius_mm);
}

/// Chooses the press's own gain and, where allowed, the model's; `settled` becomes the press under
/// it.
PressChoices choose(const BallPress& press, recon::Model& model, SettledPress& settled) {
  PressChoices chosen{press_asymmetry_of(settled), {}, {}, press.depth_mm};
  const recon::FlatFieldGain& given = press.gain;
  if (!press.may_share_light || given.shape != recon::GainShape::none ||
      !given.polynomial.empty()) {
    return chosen;
  }
  recon::Model shared = model;
  shared.gain.shape = recon::GainShape::uniform;
  SettledPress under;
  try {
    under = settle(shared, press.reference_q8.pixels, press.frames, press.ball_radius_mm);
  } catch (const std::runtime_error& e) {
    chosen.share_refused = e.what();
    return chosen;
  }
  if (!same_place(settled.contact, under.contact, press.mm_per_px)) {
    chosen.share_refused =
        fmt::format("the most of its light is lost at column {:.0f}, row {:.0f} of the depth map",
                    under.contact.col, under.contact.row);
    return chosen;
  }
  const ChosenAsymmetry gain = press_asymmetry_of(under);
  chosen.light = {false, lean_of(settled), lean_of(under)};
  const auto& plain_mm = chosen.press_asymmetry.left_out_mm;
  if (!(plain_mm && gain.left_out_mm && chosen.light->plain_per_mm > kLeans &&
        chosen.light->shared_per_mm < kLeftByTheLight * chosen.light->plain_per_mm &&
        (*gain.left_out_mm)[0] <= (*plain_mm)[0])) {
    return chosen;
  }
  chosen.light->shared = true;
  chosen.press_asymmetry = gain;
  model = std::move(shared);
  settled = std::move(under);
  return chosen;
}

void check(const BallPress& press) {
  if (press.frames.empty()) throw std::invalid_argument("no image of the ball");
  for (const image::Grey8& frame : press.frames) {
    if (frame.width != press.reference_q8.width || frame.height != press.reference_q8.height) {
      throw std::invalid_argument(fmt::format(
          "the ball's image is {}x{} but the reference is {}x{}; take both with one camera mode",
          frame.width, frame.height, press.reference_q8.width, press.reference_q8.height));
    }
  }
  check_sizes(press.ball_radius_mm, press.mm_per_px);
}

}  // namespace

void check_sizes(double ball_radius_mm, double mm_per_px) {
  if (!(ball_radius_mm >= 0.1 && ball_radius_mm <= 100)) {
    throw std::invalid_argument("the ball's radius must be 0.1 to 100 mm");
  }
  if (!(mm_per_px >= 0.001 && mm_per_px <= 1)) {
    throw std::invalid_argument("the scale must be 0.001 to 1 mm a pixel");
  }
}

image::Grey8 rectified_reference(const recon::RectifyTable& table, const image::Grey16& q8) {
  return rectified(table, [&](std::size_t at) {
    return static_cast<std::uint8_t>(std::min(255, (q8.pixels[at] + 128) / 256));
  });
}

image::Grey8 rectified_mean(const recon::RectifyTable& table,
                            const std::vector<image::Grey8>& frames) {
  const auto count = static_cast<int>(frames.size());
  return rectified(table, [&](std::size_t at) {
    int sum = 0;
    for (const image::Grey8& frame : frames) sum += frame.pixels[at];
    return static_cast<std::uint8_t>((sum + count / 2) / count);
  });
}

Calibration empty_calibration(const image::Grey16& reference_q8, const std::optional<Crop>& crop,
                              double mm_per_px, const std::optional<recon::Lens>& lens,
                              const CameraView& view) {
  const int width = reference_q8.width;
  const int height = reference_q8.height;
  const Crop part = crop.value_or(seen(lens, width, height, mm_per_px));
  auto model = std::make_shared<recon::Model>();
  std::vector<std::uint8_t> outside;
  model->rectify = map_table(lens, width, height,
                             {part.col, part.row, part.width, part.height, mm_per_px}, outside);
  add_untrusted(*model, outside);
  model->mm_per_px = mm_per_px;
  model->smoothing_px = std::min(10.0, kSmoothingMm / mm_per_px);
  model->reference_q8 = reference_q8.pixels;
  Calibration calibration;
  calibration.crop_col = part.col;
  calibration.crop_row = part.row;
  calibration.lens = lens;
  calibration.view = view;
  if (view.source != HeightSource::unknown && view.per_mm == 0) {
    calibration.view = {view.foot_mm, HeightSource::assumed, kAssumedPerMm};
  }
  if (lens) {
    const recon::Point centre =
        surface_point(*lens, {part.col, part.row, part.width, part.height, mm_per_px},
                      0.5 * (part.width - 1), 0.5 * (part.height - 1));
    calibration.view.foot_mm = {view.foot_mm.x - centre.x, view.foot_mm.y - centre.y};
  }
  model->surface.view = {calibration.view.foot_mm, calibration.view.per_mm};
  if (view.source == HeightSource::unknown) {
    calibration.view = {};
    model->surface.view = {};
  }
  calibration.model = std::move(model);
  return calibration;
}

CameraView view_with(const CameraView& view, const recon::DepthLut& lut) {
  if (view.source == HeightSource::unknown || view.per_mm != 0) return view;
  const double mm_per_level = slope_mm(lut);
  const double per_mm = view.per_level / mm_per_level;
  if (!(per_mm >= kMinPerMm && per_mm <= kMaxPerMm)) {
    return {view.foot_mm, HeightSource::assumed, kAssumedPerMm};
  }
  return {view.foot_mm, view.source, per_mm, 0, view.error / mm_per_level};
}

std::string describe(const CameraView& view) {
  if (view.source == HeightSource::unknown) return {};
  const auto from = [&] {
    switch (view.source) {
      case HeightSource::board:
        return "as the board of pins shows";
      case HeightSource::drawing:
        return "as the drawing says";
      case HeightSource::presses:
        return "as the presses show";
      default:
        return "assumed: neither a board nor presses show it";
    }
  };
  return fmt::format(
      "camera: {:.1f}{} mm above the surface ({}), its axis meets it {:.2f} mm right of and {:.2f} "
      "mm "
      "below the map's middle",
      1 / view.per_mm,
      view.error > 0 ? fmt::format(" ± {:.1f}", view.error / (view.per_mm * view.per_mm)) : "",
      from(), view.foot_mm.x, view.foot_mm.y);
}

bool reaches_corners(const recon::FlatFieldGain& gain, double width_mm, double height_mm) noexcept {
  return std::ranges::all_of(std::array{-0.5, 0.5}, [&](double right) {
    return std::ranges::all_of(std::array{-0.5, 0.5}, [&](double down) {
      const double factor = gain.polynomial_at(right * width_mm, down * height_mm);
      return factor > 0.5 && factor < 2;
    });
  });
}

recon::FlatFieldGain gain_on_map(const recon::FlatFieldGain& gain, const Calibration& calibration) {
  const recon::Model& model = *calibration.model;
  const recon::RectifyTable& map = model.rectify;
  recon::FlatFieldGain on_map = gain;
  if (calibration.lens) {
    const recon::Point centre = surface_point(
        *calibration.lens,
        {calibration.crop_col, calibration.crop_row, map.width, map.height, model.mm_per_px},
        0.5 * (map.width - 1), 0.5 * (map.height - 1));
    on_map = moved(gain, centre.x, centre.y);
  }
  if (!reaches_corners(on_map, map.width * model.mm_per_px, map.height * model.mm_per_px)) {
    on_map.polynomial.clear();
  }
  return on_map;
}

std::string gain_left_out(const recon::FlatFieldGain& gain, const Calibration& calibration) {
  if (gain.polynomial.empty() || !gain_on_map(gain, calibration).polynomial.empty()) return {};
  return "gain: the lens file's is not used: extended to the corners of the map, where no pin was, "
         "it would halve or double darkening; give the --crop that the board covered to use it";
}

DarkeningMap in_true_places(const DarkeningMap& map, const recon::Viewpoint& view,
                            const std::function<double(double level)>& depth_mm) {
  const double middle_x = 0.5 * (map.width - 1);
  const double middle_y = 0.5 * (map.height - 1);
  // NaN beyond the map, too.
  const auto level_at = [&](recon::Point mm) -> double {
    const double x = mm.x / map.mm_per_px + middle_x;
    const double y = mm.y / map.mm_per_px + middle_y;
    if (!(x >= 0 && y >= 0 && x <= map.width - 1 && y <= map.height - 1)) return NAN;
    const int left = std::min(static_cast<int>(x), map.width - 2);
    const int top = std::min(static_cast<int>(y), map.height - 2);
    return std::lerp(std::lerp(map.at(left, top), map.at(left + 1, top), x - left),
                     std::lerp(map.at(left, top + 1), map.at(left + 1, top + 1), x - left),
                     y - top);
  };
  constexpr int kRounds = 4;  // each a tenth of the distance before, or less
  DarkeningMap out = map;
  std::size_t i = 0;
  for (int y = 0; y < map.height; ++y) {
    for (int x = 0; x < map.width; ++x, ++i) {
      const recon::Point place{(x - middle_x) * map.mm_per_px, (y - middle_y) * map.mm_per_px};
      double level = map.levels[i];
      for (int round = 0; round < kRounds && !std::isnan(level); ++round) {
        level = level_at(view.seen(place, depth_mm(level)));
      }
      out.levels[i] = static_cast<float>(level);
    }
  }
  return out;
}

SettledPress settle(const recon::Model& model, std::span<const std::uint16_t> reference_q8,
                    std::span<const image::Grey8> frames, double ball_radius_mm) {
  SettledPress press;
  press.reference_q8.assign(reference_q8.begin(), reference_q8.end());
  press.map = smoothed_darkening(model, press.reference_q8, frames);
  press.contact = find_contact(press.map, ball_radius_mm);
  press.drift_levels = far_field_drift(press.map, press.contact);
  if (press.drift_levels != 0) {
    const auto drift_q8 = static_cast<int>(std::lround(256 * press.drift_levels));
    for (std::uint16_t& value : press.reference_q8) {
      value = static_cast<std::uint16_t>(std::clamp(value - drift_q8, 0, 255 * 256));
    }
    press.map = smoothed_darkening(model, press.reference_q8, frames);
    press.contact = find_contact(press.map, ball_radius_mm);
  }
  const recon::Viewpoint& view = model.surface.view;
  if (view.per_mm == 0) return press;
  const DarkeningMap seen = std::move(press.map);
  // Depth along a straight line: first that to the depth of the contact's radius, then the press's
  // own.
  const auto place_by = [&](double slope) {
    press.map = in_true_places(seen, view, [slope](double level) {
      constexpr double kBulged = 1.0 / 3;  // a bulge brightens three times as steeply
      return slope * (level < 0 ? kBulged : 1) * level;
    });
    press.contact = find_contact(press.map, ball_radius_mm);
  };
  place_by(sag_mm(ball_radius_mm, press.contact.radius_mm) / press.contact.peak_levels);
  place_by(fit_sag(press.map, press.contact).slope);
  return press;
}

SettledPress settle_unclipped(const recon::Model& model, const image::Grey16& reference_q8,
                              const std::vector<image::Grey8>& frames, double ball_radius_mm) {
  SettledPress press = settle(model, reference_q8.pixels, frames, ball_radius_mm);
  refuse_clipped(rectified_reference(model.rectify, reference_q8), press.contact, model.mm_per_px,
                 255, "the reference is white at the contact; lower the exposure or the light");
  refuse_clipped(rectified_mean(model.rectify, frames), press.contact, model.mm_per_px, 0,
                 "the ball's image is black at the contact; raise the exposure or the light");
  return press;
}

bool same_place(const Contact& a, const Contact& b, double mm_per_px) noexcept {
  return std::hypot(a.col - b.col, a.row - b.row) * mm_per_px < 0.5 * a.radius_mm;
}

std::string PressChoices::describe() const {
  std::string text;
  if (!share_refused.empty()) {
    text = fmt::format(
        "light: as it is, since as a share of the light the press is not found ({}); where a part "
        "of the map is dark, --crop leaves it out\n",
        share_refused);
  } else if (light) {
    text = fmt::format(
        "light: the press leans by {:.1f} % a mm, by {:.1f} with darkening as a share of the "
        "light: {}\n",
        100 * light->plain_per_mm, 100 * light->shared_per_mm,
        light->shared ? "the share is used" : "as it is");
  }
  text += press_asymmetry.describe();
  if (depth_mm) text += fmt::format("\nLUT: at the measured depth of {:g} mm", *depth_mm);
  return text;
}

Calibration build(const BallPress& press, PressChoices* choices) {
  check(press);
  Calibration calibration =
      empty_calibration(press.reference_q8, press.crop, press.mm_per_px, press.lens, press.view);
  auto model = std::make_shared<recon::Model>(*calibration.model);
  model->method = press.method;
  if (press.method == recon::Method::lut) model->gain = gain_on_map(press.gain, calibration);

  SettledPress settled =
      settle_unclipped(*model, press.reference_q8, press.frames, press.ball_radius_mm);
  if (press.method == recon::Method::lut) {
    const PressChoices chosen = choose(press, *model, settled);
    const SymmetricPress level =
        without_asymmetry(settled.map, settled.contact, chosen.press_asymmetry.gain);
    model->lut = fit_lut(level.map, level.contact, {}, press.depth_mm);
    if (choices != nullptr) *choices = chosen;
    model->uncertainty = uncertainty_of_zero(model->lut, std::span(&settled, 1), press.depth_mm);
  } else {
    model->lut = fit_published(rectified_reference(model->rectify, press.reference_q8),
                               rectified_mean(model->rectify, press.frames), press.ball_radius_mm,
                               press.mm_per_px);
    model->uncertainty = uncertainty_of_zero(model->lut, std::span(&settled, 1));
  }
  calibration.model = std::move(model);
  return calibration;
}

}  // namespace dtact::calibration
