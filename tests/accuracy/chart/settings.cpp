#include "tests/accuracy/chart/settings.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "clients/calibrate/fit/build.hpp"
#include "clients/calibrate/fit/contact.hpp"
#include "clients/calibrate/fit/difference.hpp"
#include "clients/calibrate/fit/list_fit.hpp"
#include "daemon/recon/decimate.hpp"

namespace dtact::chart {
namespace {

std::shared_ptr<const recon::Model> calibrate(const image::Grey16& reference, const Shot& press,
                                              recon::Method method) {
  return calibration::build({.reference_q8 = reference,
                             .frames = press.frames,
                             .ball_radius_mm = 4.0,
                             .mm_per_px = kMmPerPx,
                             .lens = {},
                             .crop = calibration::Crop{kCropCol, kCropRow, kSide, kSide},
                             .method = method})
      .model;
}

/// A map's value at a place between its pixels; none where one of the four is untrusted.
std::optional<double> bilinear(const std::vector<std::int16_t>& map, int width, int height,
                               double x, double y) {
  x = std::clamp(x, 0.0, width - 1.0);
  y = std::clamp(y, 0.0, height - 1.0);
  const int x0 = std::min(static_cast<int>(x), std::max(0, width - 2));
  const int y0 = std::min(static_cast<int>(y), std::max(0, height - 2));
  double sum = 0;
  for (int k = 0; k < 4; ++k) {
    const int px = std::min(x0 + k % 2, width - 1);
    const int py = std::min(y0 + k / 2, height - 1);
    const double wx = k % 2 == 0 ? 1 - (x - x0) : x - x0;
    const double wy = k / 2 == 0 ? 1 - (y - y0) : y - y0;
    const std::int16_t um = map[static_cast<std::size_t>(py) * static_cast<std::size_t>(width) +
                                static_cast<std::size_t>(px)];
    if (wx * wy == 0) continue;
    if (um == recon::kUntrusted) return std::nullopt;
    sum += wx * wy * um;
  }
  return sum;
}

/// What undoes the blur that was fitted to real images (config/scenes/default.toml: 0.70 of the
/// light spread by 0.20 mm, the rest by 1.23 mm, seen through a smoothing of 0.1 mm): the wide
/// part, the narrow one to first order, and half of the wide one.
constexpr std::array<Sharpening, 3> kSharpenings{{{1.23, 0.43}, {0.22, 1.0}, {1.23, 0.2}}};

/// The list of one press with the darkening sharpened, in calibration as at work.
Setting sharpened(const recon::Model& model, const image::Grey16& reference, const Shot& press,
                  const Sharpening& sharpening) {
  recon::Model levels = model;
  calibration::answer_darkening(levels);
  calibration::DifferenceMap map =
      calibration::smoothed_difference(model, reference.pixels, press.frames);
  std::vector<std::int16_t> q6;
  q6.reserve(map.levels.size());
  for (const float level : map.levels) {
    q6.push_back(static_cast<std::int16_t>(std::lround(level * recon::kEntriesPerLevel)));
  }
  std::vector<std::int16_t> sharp(q6.size());
  Sharpener(map.width, map.height, map.mm_per_px, sharpening).sharpen(q6, sharp);
  std::ranges::transform(sharp, map.levels.begin(), [](std::int16_t value) {
    return static_cast<float>(value) / recon::kEntriesPerLevel;
  });
  return {.name = fmt::format("list full sharpened {:.2f} x {:.2f}", sharpening.sigma_mm,
                              sharpening.strength),
          .method = "sharpened",
          .smoothing_mm = calibration::kSmoothingMm,
          .model = std::make_shared<const recon::Model>(std::move(levels)),
          .sharpening = sharpening,
          .sharpened_list = calibration::fit_list(map, calibration::find_contact(map, 4.0))};
}

}  // namespace

calibration::BallPresses several_presses(const image::Grey16& reference) {
  calibration::BallPresses set;
  set.reference_q8 = reference;
  for (const Shot& shot : make_calibration_presses()) {
    set.presses.push_back({.name = shot.name, .frames = shot.frames, .depth_mm = {}});
  }
  set.ball_radius_mm = 4.0;
  set.mm_per_px = kMmPerPx;
  set.crop = calibration::Crop{kCropCol, kCropRow, kSide, kSide};
  return set;
}

std::vector<Setting> make_settings(const image::Grey16& reference) {
  const Shot calibration_press = make_calibration_press();
  std::vector<Setting> settings;
  settings.push_back({"published full", "published", 1, false, 0,
                      calibrate(reference, calibration_press, recon::Method::published)});
  const calibration::BallPresses presses = several_presses(reference);
  settings.push_back(
      {"regression full", "regression", 1, false, 0, calibration::build_regression(presses).model});
  const auto list = calibrate(reference, calibration_press, recon::Method::list);
  constexpr std::array<const char*, 5> kShare{"", "full", "half", "", "quarter"};
  const auto ours = calibration::build(presses).model;
  for (const double smoothing_mm : {0.05, 0.1, 0.2, 0.4}) {
    recon::Model smoothed = *list;
    smoothed.smoothing_px = smoothing_mm / kMmPerPx;
    for (const int decimation : {1, 2, 4}) {
      const auto model =
          std::make_shared<const recon::Model>(recon::decimate(smoothed, decimation));
      for (const bool tiles : {false, true}) {
        settings.push_back(
            {fmt::format("list {}{} {:.2f}", kShare.at(static_cast<std::size_t>(decimation)),
                         tiles ? " tiles" : "", smoothing_mm),
             "list", decimation, tiles, smoothing_mm, model});
      }
    }
  }
  for (const Sharpening& sharpening : kSharpenings) {
    settings.push_back(sharpened(*list, reference, calibration_press, sharpening));
  }
  for (const int decimation : {1, 2, 4}) {
    const auto model = std::make_shared<const recon::Model>(recon::decimate(*ours, decimation));
    settings.push_back(
        {fmt::format("ours {} tiles 0.10", kShare.at(static_cast<std::size_t>(decimation))), "ours",
         decimation, true, 0.1, model});
  }
  return settings;
}

Worker::Worker(const Setting& setting, const image::Grey16& reference, const Shot& shot)
    : setting_(setting),
      shot_(shot),
      reconstructor_(setting.model),
      cells_(recon::CellLattice(setting.model->rectify)),
      readers_(cells_.lattice(), setting.model->rectify, reconstructor_.radius()),
      tiles_(static_cast<std::size_t>(readers_.grid().rows())) {
  reconstructor_.set_reference(reference.pixels);
  cells_.set_reference(reference.pixels);
  for (const image::Grey8& frame : shot.frames) {
    frames_.push_back(frame.pixels);
    frames_.back().resize(frame.pixels.size() + recon::kLumaPadding);
  }
  const recon::RectifyTable& table = setting.model->rectify;
  depth_um_.resize(static_cast<std::size_t>(table.width) * static_cast<std::size_t>(table.height));
  if (setting.sharpening) {
    sharpener_.emplace(table.width, table.height, setting.model->mm_per_px, *setting.sharpening);
    level_q6_.resize(depth_um_.size());
  }
}

void Worker::once() {
  const std::uint8_t* luma = frames_[next_].data();
  next_ = (next_ + 1) % frames_.size();
  if (sharpener_) {
    reconstructor_.run(luma, kWidth, level_q6_);
    sharpener_->look_up(level_q6_, setting_.sharpened_list, depth_um_);
  } else if (setting_.tiles) {
    (void)cells_.look({luma, kWidth, kHeight, kWidth});
    readers_.mark(cells_.active(), tiles_);
    reconstructor_.run_active(luma, kWidth, tiles_, depth_um_, drawn_);
  } else {
    reconstructor_.run(luma, kWidth, depth_um_);
  }
}

Error Worker::error() {
  // The look for what changed has seen a few frames, as it has in a running daemon.
  for (std::size_t i = 0; i < frames_.size(); ++i) once();
  Error mean;
  for (std::size_t i = 0; i < frames_.size(); ++i) {
    once();
    const Error one = error_of(depth_um_, setting_.decimation, shot_);
    mean.mean_absolute_mm += one.mean_absolute_mm / static_cast<double>(frames_.size());
    mean.untrusted_share += one.untrusted_share / static_cast<double>(frames_.size());
  }
  return mean;
}

Error error_of(const std::vector<std::int16_t>& depth_um, int decimation, const Shot& shot) {
  const int width = kSide / decimation;
  const double scale = 1.0 / decimation;
  double sum_mm = 0;
  std::int64_t trusted = 0;
  std::int64_t judged = 0;
  for (int y = 0; y < kSide; ++y) {
    for (int x = 0; x < kSide; ++x) {
      const auto at = static_cast<std::size_t>(y) * kSide + static_cast<std::size_t>(x);
      if (shot.judged[at] == 0) continue;
      ++judged;
      const auto um =
          bilinear(depth_um, width, width, (x + 0.5) * scale - 0.5, (y + 0.5) * scale - 0.5);
      if (!um) continue;
      ++trusted;
      sum_mm += std::abs(*um / 1000.0 - double{shot.truth_mm[at]});
    }
  }
  return {trusted == 0 ? NAN : sum_mm / static_cast<double>(trusted),
          judged == 0 ? 0 : 1 - static_cast<double>(trusted) / static_cast<double>(judged)};
}

}  // namespace dtact::chart
