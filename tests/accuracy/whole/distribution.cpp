#include "tests/accuracy/whole/distribution.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <stdexcept>

#include "proto/dtact.pb.h"

namespace dtact::whole {
namespace {

/// A contact at rest with this area deeper than the threshold plus twice the uncertainty must be
/// reported.
constexpr double kSurelyMm2 = 1;
bool surely_pressed(const FrameErrors& frame) {
  return frame.true_area > kSurelyMm2 &&
         frame.true_deepest > pipeline::ContactRules{}.threshold_mm + 2 * frame.stated;
}
constexpr std::size_t kWorst = 10;

double ratio(double error, double stated) { return std::abs(error) / stated; }

}  // namespace

const std::vector<Quantity>& quantities() {
  static const std::vector<Quantity> all = {
      {"depth in contact", "mm", [](const FrameErrors& f) { return f.inside; }},
      {"depth in contact / stated", "", [](const FrameErrors& f) { return f.inside_ratio(); }},
      {"depth within 1 mm beside", "mm", [](const FrameErrors& f) { return f.beside; }},
      {"depth within 1 mm beside / stated", "",
       [](const FrameErrors& f) { return f.in_contact ? ratio(f.beside, f.stated) : NAN; }},
      {"depth elsewhere", "mm", [](const FrameErrors& f) { return f.away; }},
      {"depth elsewhere / stated", "",
       [](const FrameErrors& f) { return ratio(f.away, f.stated); }},
      {"untrusted in contact", "share", [](const FrameErrors& f) { return f.untrusted; }},
      {"contact area", "share", [](const FrameErrors& f) { return std::abs(f.area); }},
      {"contact centroid", "mm", [](const FrameErrors& f) { return f.centroid; }},
      {"deepest", "mm", [](const FrameErrors& f) { return std::abs(f.deepest); }},
      {"deepest / stated", "", [](const FrameErrors& f) { return ratio(f.deepest, f.stated); }},
      {"points: mean distance", "mm", [](const FrameErrors& f) { return f.points; }},
      {"points: 95 % within", "mm", [](const FrameErrors& f) { return f.points_95; }},
      {"force", "N", [](const FrameErrors& f) { return std::abs(f.force); }},
      {"force / stated", "", [](const FrameErrors& f) { return ratio(f.force, f.stated_force); }}};
  return all;
}

Distribution distribution_of(std::vector<double> values) {
  std::erase_if(values, [](double value) { return std::isnan(value); });
  Distribution out;
  out.count = values.size();
  if (values.empty()) return out;
  std::ranges::sort(values);
  const auto above = [&](double limit) {
    const auto first = std::ranges::upper_bound(values, limit);
    return static_cast<double>(values.end() - first) / static_cast<double>(values.size());
  };
  out.median = values[values.size() / 2];
  out.p95 = values[values.size() * 95 / 100];
  out.max = values.back();
  out.above_1 = above(1);
  out.above_2 = above(2);
  return out;
}

Distribution distribution_of(const std::vector<SceneReport>& scenes, std::string_view name) {
  const auto quantity =
      std::ranges::find_if(quantities(), [&](const Quantity& q) { return name == q.name; });
  if (quantity == quantities().end()) throw std::out_of_range(std::string(name));
  std::vector<double> values;
  for (const SceneReport& scene : scenes) {
    for (const FrameErrors& frame : scene.frames) {
      if (!frame.is_flagged()) values.push_back(quantity->value(frame));
    }
  }
  return distribution_of(std::move(values));
}

ContactMistakes contact_mistakes(const std::vector<SceneReport>& scenes) {
  ContactMistakes out;
  for (const SceneReport& scene : scenes) {
    for (const FrameErrors& frame : scene.frames) {
      if (frame.is_flagged()) {
        ++out.flagged;
        continue;
      }
      if (!frame.pressed && frame.frame.phase != Phase::moving) {
        ++out.no_contact_frames;
        out.false_contacts += frame.in_contact ? 1 : 0;
      }
      if (frame.frame.phase == Phase::rest && surely_pressed(frame)) {
        ++out.contact_frames;
        out.missed += frame.in_contact ? 0 : 1;
      }
    }
  }
  return out;
}

std::string to_markdown(const std::vector<SceneReport>& scenes) {
  std::string out =
      "| quantity | frames | median | 95 % | max | above 1 | above 2 |\n"
      "| --- | --- | --- | --- | --- | --- | --- |\n";
  auto to = std::back_inserter(out);
  for (const Quantity& quantity : quantities()) {
    const Distribution d = distribution_of(scenes, quantity.name);
    const bool is_ratio = quantity.unit[0] == '\0';
    fmt::format_to(to, "| {}{}{} | {} | {:.3f} | {:.3f} | {:.3f} | {} | {} |\n", quantity.name,
                   is_ratio ? "" : ", ", quantity.unit, d.count, d.median, d.p95, d.max,
                   is_ratio ? fmt::format("{:.1f} %", 100 * d.above_1) : "",
                   is_ratio ? fmt::format("{:.1f} %", 100 * d.above_2) : "");
  }
  const ContactMistakes contacts = contact_mistakes(scenes);
  std::size_t judged = 0;
  for (const SceneReport& scene : scenes) judged += scene.frames.size();
  fmt::format_to(
      to,
      "\n{} of {} judged frames have a flag and are left out above and below.\n\nContact: {} of {} "
      "frames without an object report contact; {} of {} frames "
      "at rest that reach deeper than the threshold by twice what is stated do not.\n",
      contacts.flagged, judged, contacts.false_contacts, contacts.no_contact_frames,
      contacts.missed, contacts.contact_frames);

  fmt::format_to(to,
                 "\n| health flag | scenes that show it | without cause: scenes | frames |\n"
                 "| --- | --- | --- | --- |\n");
  int watched = 0;
  int beyond_missed = 0;
  for (const SceneReport& scene : scenes) {
    watched += scene.watched;
    beyond_missed += scene.beyond_missed;
  }
  for (std::size_t i = 0; i < pipeline::kHealthCount; ++i) {
    const auto count = [&](const auto& of) {
      return std::ranges::count_if(scenes, [&](const SceneReport& s) { return of(s) > 0; });
    };
    const auto shown = count([&](const SceneReport& s) { return s.flagged.at(i); });
    if (shown == 0) continue;
    int frames = 0;
    for (const SceneReport& scene : scenes) frames += scene.false_alarms.at(i);
    fmt::format_to(
        to, "| {} | {} | {} | {} of {} |\n", v1::Health_Name(static_cast<v1::Health>(i + 1)), shown,
        count([&](const SceneReport& s) { return s.false_alarms.at(i); }), frames, watched);
  }
  fmt::format_to(to, "\nJudged frames deeper than calibrated that do not say so: {}.\n",
                 beyond_missed);

  std::vector<const SceneReport*> worst;
  for (const SceneReport& scene : scenes) worst.push_back(&scene);
  std::ranges::sort(worst, std::ranges::greater(), &SceneReport::worst_ratio);
  worst.resize(std::min(worst.size(), kWorst));
  fmt::format_to(to,
                 "\n| worst scenes | error / stated | gel, mm | calibrated to, mm | what |\n"
                 "| --- | --- | --- | --- | --- |\n");
  for (const SceneReport* scene : worst) {
    fmt::format_to(to, "| {} | {:.2f} | {:.2f} | {:.2f} | {} |\n", scene->name, scene->worst_ratio,
                   scene->thickness_mm, scene->calibrated_mm, scene->what);
  }
  return out;
}

std::string to_csv(const std::vector<SceneReport>& scenes) {
  std::string out =
      "scene,light,thickness_mm,calibrated_mm,sequence,phase,stated,inside,beside,away,untrusted,"
      "in_contact,pressed,true_area,area,centroid,deepest,true_deepest,points,points_95,force,"
      "true_force,stated_force,health,what\n";
  for (const SceneReport& scene : scenes) {
    for (const FrameErrors& f : scene.frames) {
      fmt::format_to(
          std::back_inserter(out),
          "{},{},{:.3f},{:.3f},{},{},{:.4f},{:.4f},{:.4f},{:.4f},{:.4f},{:d},{:d},{:.3f},"
          "{:.4f},{:.4f},{:.4f},{:.4f},{:.4f},{:.4f},{:.4f},{:.4f},{:.4f},{:x},\"{}\"\n",
          scene.name, name_of(scene.light), scene.thickness_mm, scene.calibrated_mm,
          f.frame.sequence, name_of(f.frame.phase), f.stated, f.inside, f.beside, f.away,
          f.untrusted, f.in_contact, f.pressed, f.true_area, f.area, f.centroid, f.deepest,
          f.true_deepest, f.points, f.points_95, f.force, f.true_force, f.stated_force, f.health,
          scene.what);
    }
  }
  return out;
}

}  // namespace dtact::whole
