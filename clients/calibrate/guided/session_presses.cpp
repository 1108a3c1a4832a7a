// The presses of a session.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <utility>

#include "clients/calibrate/guided/session.hpp"

namespace dtact::ctl::guided {

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
    for (const TakenPress& press : coverage_.presses) depths.push_back(press.depth_mm);
    const double depth = next_depth_mm(std::move(depths), plan_.ball_radius_mm);
    text += fmt::format("about {:.1f} mm deep (contact {:.1f} mm wide)", depth,
                        contact_width_mm(depth, plan_.ball_radius_mm));
  }
  text += taken == 0 ? ", anywhere; hold still" : ", elsewhere; hold still";
  const std::string last = taken == 0 ? WorkFolder::kReference : folder_.presses().back();
  return {text, {{"", "take"}, {"r", "retake " + last}, {"p", "preview"}, {"s", "finish"}, kQuit}};
}

void Session::press_steps() {
  for (;;) {
    const std::size_t taken = images_.set.presses.size();
    if (coverage_.made && taken >= static_cast<std::size_t>(plan_.presses)) return;
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
        if (const Look* look = capture_->next()) {
          view_.still(look->image, std::nullopt);
        }
        console_.say("preview: " + folder_.at("preview.png"));
      } else if (line == "s") {
        if (coverage_.made) return;
        console_.say("that is not yet enough: " + coverage_.missing);
      } else {
        console_.say("\"" + line + "\" means nothing here");
      }
    } catch (const NotTaken& e) {
      if (!console_.interactive()) throw;
      console_.say(e.what());
    } catch (const ReferenceTouched&) {
      console_.say(
          "the surface is brighter than the reference: something touched when that was taken. It "
          "has to be taken again");
      reference_step();
      judge();
    }
  }
}

void Session::take_press(const std::string& name) {
  require_same_sensor();
  const std::string waiting =
      fmt::format("waiting up to {:g} s for a press that holds still", plan_.patience_s);
  if (console_.interactive()) {
    view_.set_prompt({waiting, {{"", "take it as it is"}, kQuit}});
  } else {
    console_.say(waiting);
  }
  const Still still = capture_->press(plan_.press_frames, untouched_, last_);
  view_.set_prompt({});
  last_ = still.cells;
  calibration::Contact contact;
  try {
    contact = calibration::settle(*empty_.model, images_.set.reference_q8.pixels, still.frames,
                                  plan_.ball_radius_mm)
                  .contact;
  } catch (const std::runtime_error& e) {
    console_.say(fmt::format("not taken: {}", e.what()));
    view_.still(still.frames.back(), std::nullopt);
    return;
  }
  const bool again = std::ranges::count(folder_.presses(), name) > 0;
  folder_.save_press(name, still.frames);
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
  coverage_ = cover(images_, empty_, plan_.force);
  view_.set_presses(coverage_.presses, coverage_.made ? covered_mm(*coverage_.made) : 0);
  if (!coverage_.made) {
    if (!images_.set.presses.empty()) console_.say("not yet a list: " + coverage_.missing);
    return;
  }
  for (const std::string& press : coverage_.report.left_out) console_.say("left out: " + press);
  for (const std::string& doubt : coverage_.doubts) console_.say("doubtful: " + doubt);
  std::vector<std::string> depths;
  depths.reserve(coverage_.report.presses.size());
  for (const auto& press : coverage_.report.presses) {
    depths.push_back(fmt::format("{:.2f}", press.depth_mm));
  }
  console_.say(fmt::format("the list covers 0 to {:.2f} mm; presses of {} mm",
                           covered_mm(*coverage_.made), fmt::join(depths, ", ")));
}

}  // namespace dtact::ctl::guided
