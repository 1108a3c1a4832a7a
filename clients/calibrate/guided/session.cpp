#include "clients/calibrate/guided/session.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <chrono>
#include <optional>
#include <utility>

#include "clients/calibrate/fit/evaluate.hpp"
#include "clients/calibrate/guided/sensor_checks.hpp"
#include "daemon/calibration/text.hpp"
#include "daemon/pipeline/reference/calibrated_image.hpp"
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
    if (!folder_.has_reference()) {
      console_.say("No image was taken yet.");
    } else if (console_.at_terminal()) {
      console_.say(
          fmt::format("The images are in {}. To continue: {}", plan_.folder.string(), plan_.again));
    } else {
      console_.say("The images are kept. To continue, begin again with the last session.");
    }
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
    console_.say("\nStep 1 of 3: the undeformed surface");
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
  console_.say(fmt::format("scale: {:.5f} mm per pixel, from {}", map.mm_per_px, map.scale_from));
  image::Grey16 black{width, height, {}};
  black.pixels.resize(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
  empty_ = calibration::empty_calibration(black, map.crop, map.mm_per_px, map.lens);
  // Comes before the first image: the daemon would refuse the map only at the upload.
  pipeline::require_coverage(empty_.model->rectify, folder_.calibration_name());
  grid_ = CellGrid(recon::region_read(empty_.model->rectify));
  cell_mm_ = grid_.cell_px() * (map.lens ? recon::central_mm_per_px(*map.lens) : map.mm_per_px);
  view_.use(empty_, {}, cell_mm_);
  capture_ = std::make_unique<Capture>(
      sensor_, console_, grid_, Capture::Rules{plan_.timeout_s},
      [this](const ObservedFrame& look, const std::string& words) { view_.show(look, words); });
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
  reference_ = grid_.of(images_.set.reference_q8.pixels, images_.set.reference_q8.width);
  view_.use(empty_, reference_, cell_mm_);
  console_.say(
      fmt::format("{}: the reference and {} press(es) are there; camera and light are "
                  "still the same",
                  plan_.folder.string(), images_.set.presses.size()));
  judge();
  (void)ask({"", {{"", "go on"}, kQuit}});
}

v1::Status Session::steady_status() {
  constexpr int kTimeout = 50;  // frames, or five seconds without one
  v1::Status status = sensor_.status();
  for (int i = 0; i < kTimeout && !unfit(status).empty(); ++i) {
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
    if (const ObservedFrame* look = capture_->next()) view_.show(*look, "live");
  }
}

void Session::reference_step() {
  // Presses that stay are of the camera's settings and light of the reference before.
  const bool presses_stay = !images_.set.presses.empty();
  if (!presses_stay) capture_->expect_light({});
  for (;;) {
    (void)ask(
        {"Take your hands off: nothing may touch the surface.", {{"", "take the images"}, kQuit}});
    try {
      const SteadyFrames still = capture_->reference(plan_.reference_frames);
      const std::string fault = fault_of(still, empty_.model->rectify);
      if (!fault.empty()) throw CaptureTimeout("not taken: " + fault);
      const v1::Status status = steady_status();
      const std::string wrong = unfit(status);
      if (!wrong.empty()) throw CaptureTimeout("not taken: " + wrong);
      if (presses_stay) require_same_sensor();
      folder_.save_reference(still.frames, origin_of(status));
      console_.say(
          fmt::format("reference taken: {} frames, steady within {:.2f} grey levels, noise {:.1f}",
                      still.frames.size(), still.drift_levels, still.noise_levels));
      load();
      capture_->expect_light(images_.origin.leds);
      reference_ = still.cells;
      view_.use(empty_, reference_, cell_mm_);
      view_.still(still.frames.back(), std::nullopt, false);
      return;
    } catch (const CaptureTimeout& e) {
      if (!console_.interactive()) throw;
      console_.say(e.what());
    }
  }
}

Prompt Session::press_prompt() const {
  const std::size_t taken = images_.set.presses.size();
  std::string text =
      fmt::format("Press {} of {}: ", taken + 1,
                  std::max<std::size_t>(taken + 1, static_cast<std::size_t>(plan_.presses)));
  if (taken >= 2 && !coverage_.made && coverage_.doubts.empty()) {
    text += "the one that is missing";
  } else {
    std::vector<double> depths;
    depths.reserve(coverage_.presses.size());
    for (const CapturedPress& press : coverage_.presses) depths.push_back(press.depth_mm);
    const double depth = next_depth_mm(std::move(depths), plan_.ball_radius_mm);
    text += fmt::format("about {:.1f} mm deep (contact {:.1f} mm wide)", depth,
                        contact_width_mm(depth, plan_.ball_radius_mm));
  }
  text += taken == 0 ? ", anywhere; hold still" : ", elsewhere; hold still";
  const std::string last = taken == 0 ? WorkFolder::kReference : folder_.presses().back();
  return {
      text,
      {{"", "take the press"}, {"r", "retake " + last}, {"p", "preview"}, {"s", "finish"}, kQuit}};
}

void Session::press_steps() {
  for (;;) {
    const std::size_t taken = images_.set.presses.size();
    if (taken >= static_cast<std::size_t>(plan_.presses) && make()) return;
    if (taken > 0) console_.say("");
    const std::string line = ask(press_prompt());
    try {
      if (line.empty()) {
        take_press(folder_.next_press());
      } else if (line == "r" && taken == 0) {
        reference_step();
      } else if (line == "r") {
        take_press(folder_.presses().back());
      } else if (line == "p") {
        if (const ObservedFrame* look = capture_->next()) {
          view_.still(look->image, std::nullopt);
        }
        if (console_.at_terminal()) console_.say("preview: " + folder_.at("preview.png"));
      } else if (line == "s") {
        if (make()) return;
        console_.say("that is not yet enough: " + coverage_.missing);
      } else {
        console_.say("\"" + line + "\" means nothing here");
      }
    } catch (const CaptureTimeout& e) {
      if (!console_.interactive()) throw;
      console_.say(e.what());
    } catch (const ReferenceInContact&) {
      console_.say(
          "the surface is brighter than the reference: there was contact when that was taken. It "
          "has to be taken again");
      reference_step();
      judge();
    }
  }
}

void Session::take_press(const std::string& name) {
  require_same_sensor();
  const std::string waiting =
      fmt::format("waiting up to {:g} s for a press that holds still", plan_.timeout_s);
  if (console_.interactive()) {
    view_.set_prompt({waiting, {{"", "take the press as it is"}, kQuit}});
  } else {
    console_.say(waiting);
  }
  const SteadyFrames still = capture_->press(plan_.press_frames, reference_, last_);
  view_.set_prompt({});
  calibration::Contact contact;
  try {
    contact = calibration::settle_unclipped(*empty_.model, images_.set.reference_q8, still.frames,
                                            plan_.ball_radius_mm)
                  .contact;
  } catch (const std::runtime_error& e) {
    console_.say(fmt::format("not taken: {}", e.what()));
    view_.still(still.frames.back(), std::nullopt);
    return;
  }
  const bool again = std::ranges::count(folder_.presses(), name) > 0;
  folder_.save_press(name, still.frames);
  last_ = still.cells;
  if (again) {
    load();
  } else {
    add_press(images_, folder_.at(name));
  }
  view_.still(still.frames.back(), contact);
  console_.say(fmt::format(
      "{} taken: a contact {:.1f} mm wide at column {:.0f}, row {:.0f} of the map, darkest {:.0f} "
      "grey levels, about {:.1f} mm deep",
      name, 2 * contact.radius_mm, contact.col, contact.row, contact.peak_levels,
      depth_of_width_mm(2 * contact.radius_mm, plan_.ball_radius_mm)));
  judge();
}

void Session::judge() {
  made_.reset();
  coverage_ = cover(images_, empty_, plan_.force);
  view_.set_presses(coverage_.presses, coverage_.made ? covered_mm(*coverage_.made) : 0);
  if (!coverage_.made) {
    if (!images_.set.presses.empty()) console_.say("not yet a LUT: " + coverage_.missing);
    return;
  }
  for (const std::string& press : coverage_.report.left_out) console_.say("left out: " + press);
  for (const std::string& doubt : coverage_.doubts) console_.say("doubtful: " + doubt);
  std::vector<std::string> depths;
  depths.reserve(coverage_.report.presses.size());
  for (const auto& press : coverage_.report.presses) {
    depths.push_back(fmt::format("{:.2f}", press.depth_mm));
  }
  console_.say(fmt::format("the LUT covers 0 to {:.2f} mm; presses of {} mm",
                           covered_mm(*coverage_.made), fmt::join(depths, ", ")));
}

bool Session::make() {
  if (made_) return *made_;
  made_ = plan_.method == FitMethod::alone && coverage_.made != nullptr;
  if (plan_.method == FitMethod::alone || images_.set.presses.size() < 2) return *made_;
  // The gel may replace a missing press, for example a lighter one that is too faint to be seen;
  // and a LUT may be doubtful only with the gel.
  std::string missing;
  try {
    calibration::PressReport report;
    auto list =
        std::make_shared<const calibration::Calibration>(build_lut(images_, plan_.method, &report));
    const std::vector<std::string> doubts = calibration::doubts_about(*list, images_.set);
    if (doubts.empty() || plan_.force) {
      for (const std::string& doubt : doubts) {
        if (std::ranges::count(coverage_.doubts, doubt) == 0) console_.say("doubtful: " + doubt);
      }
      coverage_.made = std::move(list);
      coverage_.report = std::move(report);
      return *(made_ = true);
    }
    missing = doubted(doubts);
  } catch (const std::exception& e) {
    missing = e.what();
  }
  if (missing != coverage_.missing) console_.say("not yet a LUT: " + missing);
  coverage_.missing = missing;
  return false;
}

Outcome Session::finish() {
  calibration::save(*coverage_.made, folder_.path() / kCalibration);
  console_.say(report_text(coverage_.report) + lut_text(*coverage_.made->model) +
               (console_.at_terminal() ? "saved in " + folder_.at(kCalibration) : "saved"));
  std::string line;
  try {
    line = ask({fmt::format("Upload it to the daemon as {}?", folder_.calibration_name()),
                {{"", "yes"}, {"n", "not now"}}});
  } catch (const Ended&) {
    line = "n";  // The calibration is saved, so the session has succeeded.
  }
  if (line.empty() || line == "y" || line == "yes") {
    upload();
    return Outcome::uploaded;
  }
  if (console_.at_terminal()) {
    console_.say("not uploaded; later: dtactctl calibration upload " + folder_.at(kCalibration));
  } else {
    console_.say("Not uploaded. The calibration is kept: begin again with the last session.");
  }
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
                  "it sees the undeformed surface",
                  status.calibration().name()));
}

}  // namespace dtact::ctl::guided
