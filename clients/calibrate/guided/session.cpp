#include "clients/calibrate/guided/session.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <chrono>
#include <optional>
#include <utility>

#include "clients/calibrate/guided/fitness.hpp"
#include "daemon/calibration/text.hpp"
#include "hal/base/atomic_file.hpp"

namespace dtact::ctl::guided {
namespace {

namespace fs = std::filesystem;

constexpr const char* kCalibration = "calibration";

}  // namespace

Session::Session(Sensor& sensor, Console& console, Plan plan)
    : sensor_(sensor),
      console_(console),
      plan_(std::move(plan)),
      folder_(plan_.folder),
      view_(console, folder_, plan_.presses) {}

Outcome Session::run() {
  const auto kept = [this] {
    console_.say(folder_.has_reference() ? fmt::format("What was taken lies in {}. To go on: {}",
                                                       plan_.folder.string(), plan_.again)
                                         : std::string("Nothing was taken yet."));
  };
  try {
    return guide();
  } catch (const Ended& ended) {
    console_.say(ended.why == Ended::Why::input ? "The input ended before there was a calibration."
                                                : "Ended.");
    kept();
    return Outcome::unfinished;
  } catch (const std::exception&) {
    if (folder_.has_reference()) kept();
    throw;
  }
}

Outcome Session::guide() {
  greet();
  folder_.require_ball(plan_.ball_radius_mm);
  if (folder_.has_reference()) {
    resume();
  } else {
    console_.say("\nStep 1 of 3: the untouched surface");
    reference_step();
  }
  console_.say(
      fmt::format("\nStep 2 of 3: press a ball of {:g} mm radius, at different places and depths",
                  plan_.ball_radius_mm));
  press_steps();
  console_.say("\nStep 3 of 3: the calibration");
  return finish();
}

void Session::greet() {
  const v1::Status status = steady_status();
  const auto lit = std::ranges::count_if(status.light().leds(), [](const v1::Rgb& led) {
    return led.r() > 0 || led.g() > 0 || led.b() > 0;
  });
  console_.say(
      fmt::format("{}: camera {}, {}x{} {} at {:g} fps; light {} of 255, {} of {} LEDs lit; {}",
                  sensor_.program(), status.camera().identity(), status.camera().width(),
                  status.camera().height(), status.camera().pixel_format(), status.camera().fps(),
                  status.light().brightness(), lit, status.light().leds_size(),
                  status.has_calibration() ? "calibration in use: " + status.calibration().name()
                                           : std::string("no calibration yet")));
  const std::string wrong = unfit(status);
  if (!wrong.empty()) {
    throw std::runtime_error("the sensor is not fit to be calibrated: " + wrong);
  }
  prepare_map(status);
}

void Session::prepare_map(const v1::Status& status) {
  const auto width = static_cast<int>(status.camera().width());
  const auto height = static_cast<int>(status.camera().height());
  const MapChoice map = choose_map(plan_.map, width, height);
  image::Grey16 black{width, height, {}};
  black.pixels.resize(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
  empty_ = calibration::empty_calibration(black, map.crop, map.mm_per_px, map.lens);
  grid_ = CellGrid(recon::region_read(empty_.model->rectify));
  cell_mm_ = grid_.cell_px() * (map.lens ? recon::central_mm_per_px(*map.lens) : map.mm_per_px);
  view_.use(empty_, {}, cell_mm_);
  capture_ = std::make_unique<Capture>(
      sensor_, console_, grid_, Capture::Rules{plan_.patience_s},
      [this](const Look& look, const std::string& words) { view_.show(look, words); });
}

void Session::load() {
  images_ = begin_presses({folder_.at(WorkFolder::kReference)}, plan_.ball_radius_mm, plan_.map);
  for (const std::string& name : folder_.presses()) add_press(images_, folder_.at(name));
  const calibration::BallPresses& set = images_.set;
  empty_ = calibration::empty_calibration(set.reference_q8, set.crop, set.mm_per_px, set.lens);
}

void Session::resume() {
  load();
  require_same_sensor();
  untouched_ = grid_.of(images_.set.reference_q8.pixels, images_.set.reference_q8.width);
  view_.use(empty_, untouched_, cell_mm_);
  console_.say(
      fmt::format("{}: the reference and {} press(es) are there; camera and light are "
                  "still the same",
                  plan_.folder.string(), images_.set.presses.size()));
  judge();
  (void)ask({"", {{"", "go on"}, kQuit}});
}

v1::Status Session::steady_status() {
  constexpr int kPatience = 50;  // frames, or five seconds without one
  v1::Status status = sensor_.status();
  for (int i = 0; i < kPatience && !unfit(status).empty(); ++i) {
    (void)sensor_.next(std::chrono::milliseconds(100));
    status = sensor_.status();
  }
  return status;
}

void Session::require_same_sensor() {
  const v1::Status status = steady_status();
  const std::string wrong = unfit(status);
  if (!wrong.empty()) throw std::runtime_error(wrong);
  const image::Grey16& reference = images_.set.reference_q8;
  const std::vector<std::string> found =
      differences(images_.origin, status, reference.width, reference.height);
  if (found.empty()) {
    capture_->expect_light(images_.origin.leds);
    return;
  }
  throw std::runtime_error(fmt::format(
      "since the reference in {} was taken, the sensor changed: {}. Set it back (camera: the "
      "daemon's configuration; light: dtactctl led), or begin again in another --folder",
      plan_.folder.string(), fmt::join(found, "; ")));
}

std::string Session::ask(const Prompt& prompt) {
  if (!console_.interactive()) console_.say(text_of(prompt));
  view_.set_prompt(prompt);
  for (;;) {
    const Typed typed = console_.typed();
    switch (typed.kind) {
      case Typed::Kind::interrupted:
        throw Ended{Ended::Why::interrupt};
      case Typed::Kind::end:
        throw Ended{Ended::Why::input};
      case Typed::Kind::line:
        if (typed.line == "q") throw Ended{Ended::Why::quit};
        view_.set_prompt({});
        return typed.line;
      case Typed::Kind::nothing:
        break;
    }
    if (const Look* look = capture_->next()) view_.show(*look, "live");
  }
}

void Session::reference_step() {
  capture_->expect_light({});
  for (;;) {
    (void)ask({"Take your hands off: nothing may touch the surface.", {{"", "take"}, kQuit}});
    try {
      const Still still = capture_->untouched(plan_.reference_frames);
      const std::string fault = fault_of(still, empty_.model->rectify);
      if (!fault.empty()) throw NotTaken("not taken: " + fault);
      const v1::Status status = steady_status();
      const std::string wrong = unfit(status);
      if (!wrong.empty()) throw NotTaken("not taken: " + wrong);
      folder_.save_reference(still.frames, origin_of(status));
      console_.say(
          fmt::format("reference taken: {} frames, steady within {:.2f} grey levels, noise {:.1f}",
                      still.frames.size(), still.drift_levels, still.noise_levels));
      load();
      capture_->expect_light(images_.origin.leds);
      untouched_ = still.cells;
      view_.use(empty_, untouched_, cell_mm_);
      view_.still(still.frames.back(), std::nullopt, false);
      return;
    } catch (const NotTaken& e) {
      if (!console_.interactive()) throw;
      console_.say(e.what());
    }
  }
}

Outcome Session::finish() {
  calibration::save(*coverage_.made, folder_.path() / kCalibration);
  console_.say(report_text(coverage_.report) + list_text(*coverage_.made->model) + "saved in " +
               folder_.at(kCalibration));
  const std::string line =
      ask({fmt::format("Upload it to the daemon as {}?", folder_.calibration_name()),
           {{"", "yes"}, {"n", "not now"}}});
  if (line.empty() || line == "y") {
    upload();
    return Outcome::uploaded;
  }
  console_.say("not uploaded; later: dtactctl calibration upload " + folder_.at(kCalibration));
  return Outcome::kept;
}

void Session::upload() {
  const fs::path made = folder_.path() / kCalibration;
  v1::UploadCalibration files;
  files.set_name(folder_.calibration_name());
  files.set_calibration_toml(base::read_file(made / calibration::kTomlName));
  files.set_reference_png(base::read_file(made / calibration::kReferenceName));
  sensor_.upload(files);
  const v1::Status status = sensor_.status();
  if (status.calibration().created() != coverage_.made->origin.created) {
    throw std::runtime_error(
        "the daemon took the calibration but uses another: see dtactctl status");
  }
  console_.say(
      fmt::format("the daemon uses calibration {} from now on; take the ball away, so that "
                  "it sees the untouched surface",
                  status.calibration().name()));
}

}  // namespace dtact::ctl::guided
