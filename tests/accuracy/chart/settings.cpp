#include "tests/accuracy/chart/settings.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <stdexcept>
#include <utility>

#include "clients/calibrate/fit/build.hpp"
#include "clients/calibrate/fit/model/auto_build.hpp"
#include "daemon/recon/model.hpp"
#include "hal/sim/payload.hpp"
#include "tests/accuracy/chart/virtual_balls.hpp"

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
                             .view = kView,
                             .method = method})
      .model;
}

/// A map's value between its pixels; nothing where one of the four is untrusted.
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

calibration::BallPresses press_set(const image::Grey16& reference, const std::vector<Shot>& shots) {
  calibration::BallPresses set;
  set.reference_q8 = reference;
  for (const Shot& shot : shots) {
    set.presses.push_back({.name = shot.name, .frames = shot.frames, .depth_mm = {}});
  }
  set.ball_radius_mm = 4.0;
  set.mm_per_px = kMmPerPx;
  set.view = kView;
  set.crop = calibration::Crop{kCropCol, kCropRow, kSide, kSide};
  return set;
}

}  // namespace

calibration::BallPresses several_presses(const image::Grey16& reference) {
  return press_set(reference, make_calibration_presses());
}

std::vector<Setting> make_settings(const image::Grey16& reference) {
  const Shot calibration_press = make_calibration_press();
  std::vector<Setting> settings;
  settings.push_back({"published full", "published", 1, false, 0,
                      calibrate(reference, calibration_press, recon::Method::published)});
  const calibration::BallPresses presses = several_presses(reference);
  settings.push_back(
      {"regression full", "regression", 1, false, 0, calibration::build_regression(presses).model});
  const auto lut = calibrate(reference, calibration_press, recon::Method::lut);
  constexpr std::array<const char*, 5> kShare{"", "full", "half", "", "quarter"};
  const auto several = calibration::build(presses).model;
  for (const double smoothing_mm : {0.05, 0.1, 0.2, 0.4}) {
    recon::Model smoothed = *lut;
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
  const auto balls = std::make_shared<const recon::Model>(
      recon::decimate(with_luts_of_virtual_balls(*lut, reference), 4));
  calibration::PressReport report;
  const auto ours =
      calibration::build_auto(press_set(reference, {calibration_press}), {}, report).model;
  const auto ours_quarter = std::make_shared<const recon::Model>(recon::decimate(*ours, 4));
  for (const bool tiles : {false, true}) {
    for (const int steps : {0, 1, 2}) {
      const std::string rest = fmt::format("quarter{} 0.10{}", tiles ? " tiles" : "",
                                           steps == 0 ? "" : fmt::format(" sharpened {}x", steps));
      settings.push_back({"virtual balls " + rest, "virtual balls", 4, tiles, 0.1, balls, steps});
      settings.push_back({"ours " + rest, "ours", 4, tiles, 0.1, ours_quarter, steps});
    }
    settings.push_back(
        {tiles ? "ours full tiles 0.10" : "ours full 0.10", "ours", 1, tiles, 0.1, ours});
  }
  for (const int decimation : {1, 2, 4}) {
    const auto model = std::make_shared<const recon::Model>(recon::decimate(*several, decimation));
    settings.push_back(
        {fmt::format("several {} tiles 0.10", kShare.at(static_cast<std::size_t>(decimation))),
         "several", decimation, true, 0.1, model});
  }
  for (const auto& [decimation, scale] :
       std::vector<std::pair<int, int>>{{1, 1}, {2, 1}, {2, 2}, {4, 1}, {4, 4}}) {
    const recon::Model frames = scale == 1 ? *ours : recon::for_scaled_frames(*ours, scale);
    settings.push_back(
        {fmt::format("MJPEG{} {} tiles 0.10",
                     scale == 1 ? "" : fmt::format(" decoded at 1/{}", scale),
                     kShare.at(static_cast<std::size_t>(decimation))),
         "MJPEG", decimation, true, 0.1,
         std::make_shared<const recon::Model>(recon::decimate(frames, decimation / scale)), 0,
         scale});
  }
  return settings;
}

JpegShot::JpegShot(const std::vector<image::Grey8>& frames, int decode_scale)
    : decoder_(kWidth, kHeight, decode_scale),
      luma_(kWidth / decode_scale, kHeight / decode_scale) {
  hal::sim::PayloadEncoder encoder(hal::sim::Output::mjpeg, kWidth, kHeight);
  for (const image::Grey8& frame : frames) {
    std::vector<std::uint8_t> payload(encoder.capacity());
    payload.resize(encoder.encode({frame.pixels.data(), kWidth, kHeight, kWidth}, payload));
    payloads_.push_back(std::move(payload));
  }
}

void JpegShot::set_crop(const recon::FrameRegion& crop) noexcept {
  decoder_.set_crop({crop.x, crop.y, crop.width, crop.height});
}

hal::LumaView JpegShot::decode(std::size_t frame) {
  if (decoder_.decode(payloads_[frame], luma_.data(), luma_.stride()) != hal::mjpeg::Status::ok) {
    throw std::runtime_error("the decoder refuses a frame of the simulated camera");
  }
  return luma_.view();
}

image::Grey16 reference_for(const Setting& setting, const image::Grey16& reference) {
  if (setting.decode_scale == 0) return reference;
  constexpr int kFrames = 32;
  // Not the frames that are judged: the noise of the first ones is that of the shots.
  JpegShot jpegs(shoot("reference", "", 2 * kFrames).frames, setting.decode_scale);
  const int width = kWidth / setting.decode_scale;
  const int height = kHeight / setting.decode_scale;
  std::vector<std::uint32_t> sum(static_cast<std::size_t>(width) *
                                 static_cast<std::size_t>(height));
  for (std::size_t i = 0; i < kFrames; ++i) {
    const hal::LumaView luma = jpegs.decode(kFrames + i);
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x)
        sum[static_cast<std::size_t>(y * width + x)] += luma.row(y)[x];
    }
  }
  image::Grey16 mean{width, height, {}};
  for (const std::uint32_t s : sum) {
    mean.pixels.push_back(static_cast<std::uint16_t>((s * 256 + kFrames / 2) / kFrames));
  }
  return mean;
}

Worker::Worker(const Setting& setting, const image::Grey16& reference, const Shot& shot)
    : setting_(setting),
      shot_(shot),
      reconstructor_(setting.model, setting.steps),
      cells_(recon::CellLattice(setting.model->rectify)),
      readers_(cells_.lattice(), setting.model->rectify, reconstructor_.radius()),
      tiles_(static_cast<std::size_t>(readers_.grid().rows())) {
  reconstructor_.set_reference(reference.pixels);
  cells_.set_reference(reference.pixels);
  if (setting.decode_scale != 0) {
    jpegs_.emplace(shot.frames, setting.decode_scale);
    jpegs_->set_crop(cells_.lattice().region());
  } else {
    for (const image::Grey8& frame : shot.frames) {
      frames_.push_back(frame.pixels);
      frames_.back().resize(frame.pixels.size() + recon::kLumaPadding);
    }
  }
  const recon::RectifyTable& table = setting.model->rectify;
  depth_um_.resize(static_cast<std::size_t>(table.width) * static_cast<std::size_t>(table.height));
}

void Worker::once() {
  const hal::LumaView luma = jpegs_ ? jpegs_->decode(next_)
                                    : hal::LumaView{frames_[next_].data(), kWidth, kHeight, kWidth};
  next_ = (next_ + 1) % shot_.frames.size();
  if (setting_.tiles) {
    (void)cells_.look(luma);
    readers_.mark(cells_.active(), tiles_);
    reconstructor_.run_active(luma.data, luma.stride, tiles_, depth_um_, drawn_);
  } else {
    reconstructor_.run(luma.data, luma.stride, depth_um_);
  }
}

Error Worker::error() {
  // The activity check has seen a few frames, as in a running daemon.
  const std::size_t frames = shot_.frames.size();
  for (std::size_t i = 0; i < frames; ++i) once();
  Error mean;
  for (std::size_t i = 0; i < frames; ++i) {
    once();
    const Error one = error_of(depth_um_, setting_.decimation, shot_);
    mean.mean_absolute_mm += one.mean_absolute_mm / static_cast<double>(frames);
    mean.untrusted_share += one.untrusted_share / static_cast<double>(frames);
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
