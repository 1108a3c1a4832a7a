#include "clients/calibrate/guided/json_console.hpp"

#include <ostream>
#include <utility>

#include "clients/common/guided.pb.h"
#include "clients/common/json.hpp"

namespace dtact::ctl::guided {

JsonConsole::JsonConsole(int in, std::ostream& out, std::function<bool()> interrupted)
    : in_(in), out_(out), interrupted_(std::move(interrupted)) {}

Typed JsonConsole::typed() {
  if (interrupted_()) return {Typed::Kind::interrupted, {}};
  (void)in_.fetch();
  return in_.take();
}

void JsonConsole::say(const std::string& text) {
  cli::GuidedLine line;
  line.set_said(text);
  out_ << cli::json_line(line) << std::flush;
}

void JsonConsole::live(const Scene& scene) {
  cli::GuidedLine line;
  cli::GuidedScene& told = *line.mutable_scene();
  if (scene.picture != nullptr) told.set_picture_png(image::encode_png(*scene.picture));
  told.set_mm_per_px(scene.mm_per_px);
  told.set_words(scene.words);
  told.set_prompt(scene.prompt.text);
  for (const Answer& answer : scene.prompt.answers) {
    cli::GuidedAnswer& added = *told.add_answers();
    added.set_key(answer.key);
    added.set_words(answer.words);
  }
  for (const TakenPress& press : scene.presses) {
    cli::GuidedPress& added = *told.add_presses();
    added.set_name(press.name);
    added.set_col(press.col);
    added.set_row(press.row);
    added.set_radius_px(press.radius_px);
    added.set_depth_mm(press.depth_mm);
  }
  told.set_covered_mm(scene.covered_mm);
  told.set_presses_wanted(static_cast<std::uint32_t>(scene.presses_wanted));
  out_ << cli::json_line(line) << std::flush;
}

}  // namespace dtact::ctl::guided
