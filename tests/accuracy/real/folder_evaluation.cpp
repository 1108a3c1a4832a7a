#include "tests/accuracy/real/folder_evaluation.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <stdexcept>
#include <utility>

#include "clients/calibrate/fit/build.hpp"
#include "clients/calibrate/fit/evaluate.hpp"
#include "clients/calibrate/offline/images.hpp"

namespace dtact::ctl {
namespace {

namespace fs = std::filesystem;

/// The reference and the press of one object, or why they are missing.
std::string load_pair(const fs::path& folder, const char* object, ImageSet& reference,
                      ImageSet& press) {
  const fs::path reference_path = folder / (std::string(object) + "_reference.png");
  const fs::path press_path = folder / (std::string(object) + ".png");
  for (const fs::path& path : {reference_path, press_path}) {
    if (!fs::exists(path)) return path.filename().string() + " is not there";
  }
  reference = load_images({reference_path.string()}, reference_path.string());
  press = load_images({press_path.string()}, press_path.string());
  require_same_size(reference, reference_path.string(), press, press_path.string());
  return {};
}

void evaluate_ball(FolderEvaluation& e, const recon::Lens& lens, double radius_mm) {
  calibration::BallPress press;
  press.reference_q8 = e.ball_reference.mean_q8();
  press.frames = e.ball_images.frames();
  press.ball_radius_mm = radius_mm;
  press.lens = lens;
  press.gain = e.gain.gain;
  press.mm_per_px = recon::central_mm_per_px(lens);
  const calibration::Calibration made = calibration::build(press);
  e.ball = calibration::evaluate(made, press.reference_q8.pixels, press.frames, radius_mm);
  e.calibration = made;
}

}  // namespace

FolderEvaluation evaluate_folder(const fs::path& folder, const Board& board,
                                 double ball_radius_mm) {
  if (!fs::is_directory(folder)) throw std::runtime_error(folder.string() + ": no such folder");
  FolderEvaluation e;
  e.no_pins = load_pair(folder, "board", e.board_reference, e.board);
  if (e.no_pins.empty()) {
    try {
      const cv::Mat1f reference_image = mean_levels(e.board_reference);
      const cv::Mat1f frame = mean_levels(e.board);
      PinPress pins = find_pins(reference_image, frame, board);
      e.gain = choose_gain(reference_image, frame, pins.marks,
                           calibration::kSmoothingMm / recon::central_mm_per_px(pins.lens.lens));
      e.pins = std::move(pins);
    } catch (const std::runtime_error& error) {
      e.no_pins = error.what();
    }
  }
  e.no_ball = load_pair(folder, "ball", e.ball_reference, e.ball_images);
  if (e.no_ball.empty() && !e.pins) e.no_ball = "without a lens there is no scale";
  if (e.pins && e.no_ball.empty()) {
    try {
      require_same_size(e.board, "board.png", e.ball_images, "ball.png");
      evaluate_ball(e, e.pins->lens.lens, ball_radius_mm);
    } catch (const std::runtime_error& error) {
      e.no_ball = error.what();
    }
  }
  if (!e.pins || !e.calibration) {
    e.no_pin_depths = e.pins ? "without a ball there is no LUT" : "without the pins' places";
    return e;
  }
  try {
    e.pin_depths = read_pins(*e.pins, e.gain, *e.calibration, e.board_reference.mean_q8().pixels,
                             e.board.frames(), board);
  } catch (const std::runtime_error& error) {
    e.no_pin_depths = error.what();
  }
  return e;
}

std::vector<std::string> lines_of(const FolderEvaluation& e) {
  std::vector<std::string> lines;
  if (e.pins) {
    const ChosenLens& lens = e.pins->lens;
    lines.push_back(fmt::format(
        "lens: {} pins ({} rows, {} columns), RMS distance from the ideal grid {:.4f} mm in "
        "sample, "
        "{:.4f} mm each left out; {} parameters; {:.5f} mm per pixel in the middle",
        e.pins->marks.size(), e.pins->rows, e.pins->cols, rms(lens.in_sample), rms(lens.left_out),
        parameters(lens.model), recon::central_mm_per_px(lens.lens)));
    if (!e.pins->missing.empty()) {
      lines.push_back(fmt::format("lens: pins not found: {}", fmt::join(e.pins->missing, "; ")));
    }
    lines.push_back(e.gain.describe());
  } else {
    lines.push_back("lens: skipped: " + e.no_pins);
  }
  if (e.ball && e.calibration) {  // made from this ball
    lines.push_back(fmt::format(
        "ball: contact at row {:.1f}, column {:.1f} of the rectified image, offset {:+.4f} mm "
        "taken "
        "off; mean absolute error {:.4f} mm in sample, {:.4f} mm half-disc (worst of eight "
        "{:.4f}), "
        "{:.4f} mm in left-out sectors",
        e.ball->contact.row, e.ball->contact.col, e.ball->offset_mm, e.ball->mae_mm,
        e.ball->half_mae_mm.value_or(0), e.ball->half_worst_mm.value_or(0),
        e.ball->sector_mae_mm.value_or(0)));
    lines.push_back(
        "LUT: of the ball's known sphere alone (--method list), also where a calibration would be "
        "refused");
    lines.push_back(e.ball->press_asymmetry.describe());
    if (std::string left_out = calibration::gain_left_out(e.gain.gain, *e.calibration);
        !left_out.empty()) {
      lines.push_back(std::move(left_out));
    }
    for (const auto& doubts : {calibration::doubts_about(*e.ball),
                               calibration::doubts_about(e.calibration->model->lut)}) {
      for (const std::string& doubt : doubts) {
        lines.push_back("ball: a calibration would be refused: " + doubt);
      }
    }
  } else {
    lines.push_back("ball: skipped: " + e.no_ball);
  }
  if (e.pin_depths) {
    const PinDepths& p = *e.pin_depths;
    lines.push_back(fmt::format(
        "pin depths: {} pins, mean {:.3f} mm, spread (std/mean) {:.1f} % after a tilt of {:+.2f}, "
        "{:+.2f} "
        "um/mm",
        p.mm.size(), p.mean_mm, 100 * p.spread, p.tilt_x_um_per_mm, p.tilt_y_um_per_mm));
  } else {
    lines.push_back("pin depths: skipped: " + e.no_pin_depths);
  }
  return lines;
}

}  // namespace dtact::ctl
