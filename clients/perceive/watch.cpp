#include "clients/perceive/watch.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <chrono>
#include <memory>
#include <ostream>
#include <string>

#include "clients/common/interruptible.hpp"
#include "clients/common/json.hpp"
#include "clients/cpp/names.hpp"

namespace dtact::perceive {
namespace {

using Clock = std::chrono::steady_clock;

v1::Subscribe wanted() {
  v1::Subscribe subscription;
  subscription.set_summary(true);
  subscription.set_cloud(v1::CLOUD_INT16);
  subscription.set_contact_box(true);
  subscription.set_pose(true);
  subscription.set_recognition(true);
  subscription.set_events(false);
  return subscription;
}

/// "tracked".
std::string name_of(v1::ObjectPose::Tracking tracking) {
  std::string name(v1::ObjectPose::Tracking_Name(tracking));
  std::ranges::transform(name, name.begin(),
                         [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return name;
}

/// "  tracked: moved (1.02, 0.00, -0.10) mm, ...", "  nut tracked: at ...", "  nut searching".
std::string words_of(const v1::ObjectPose& pose) {
  const std::string object = pose.object().empty() ? "" : pose.object() + " ";
  if (pose.tracking() == v1::ObjectPose::SEARCHING) {
    return fmt::format("  {}searching, in {:.2f} ms", object, pose.track_ns() * 1e-6);
  }
  const auto& moved = pose.translation_mm();
  const auto& turned = pose.rotation_deg();
  std::string line = fmt::format(
      "  {}{}: {} ({:.2f}, {:.2f}, {:.2f}) mm, turned ({:.1f}, {:.1f}, {:.1f}) deg, {} of 6 "
      "directions seen, {:.0f} um off, in {:.2f} ms",
      object, name_of(pose.tracking()), object.empty() ? "moved" : "at", moved.x(), moved.y(),
      moved.z(), turned.x(), turned.y(), turned.z(), 6 - pose.unobservable_size(),
      pose.residual_um(), pose.track_ns() * 1e-6);
  if (pose.alternatives() > 0) line += fmt::format(", or {} others", pose.alternatives());
  return line;
}

/// "  nut (94 %)", "  an unknown object", "  bolt (51 %) or cylinder (45 %)".
std::string words_of(const v1::Recognition& found) {
  const auto candidate = [&](int i) {
    const auto& one = found.candidates(i);
    return fmt::format("{} ({:.0f} %)", one.name(), 100 * one.probability());
  };
  switch (found.verdict()) {
    case v1::Recognition::UNKNOWN:
      return "  an unknown object";
    case v1::Recognition::TOO_SHALLOW:
      return "  too shallow to recognise";
    case v1::Recognition::CUT_OFF:
      return "  too far outside the map to recognise";
    default:
      break;
  }
  if (found.candidates_size() < 2) return "";
  if (found.verdict() == v1::Recognition::KNOWN) return "  " + candidate(0);
  return fmt::format("  {} or {}", candidate(0), candidate(1));
}

/// "  1.20 N +- 0.03", "  force not calibrated", "  force cut_off".
std::string force_words(const v1::Contact& contact) {
  if (contact.has_force_n()) {
    return fmt::format("  {:.2f} N +- {:.2f}", contact.force_n(), contact.force_uncertainty_n());
  }
  return contact.force_absence() > v1::FORCE_ABSENCE_UNCALIBRATED
             ? "  force " + client::name_of(contact.force_absence())
             : "  force not calibrated";
}

void watch(const cli::Context& context, double seconds) {
  const cli::Interruptible interruptible;
  client::Client client(context.target);
  client.subscribe(wanted());
  const auto start = Clock::now();
  auto reported = start;
  int frames = 0;
  while (!cli::Interruptible::happened()) {
    const auto item = client.next(std::chrono::milliseconds(100));
    const auto now = Clock::now();
    if (seconds > 0 && now - start > std::chrono::duration<double>(seconds)) break;
    const auto* frame = item ? std::get_if<v1::Frame>(&*item) : nullptr;
    if (frame != nullptr) ++frames;
    const std::chrono::duration<double> passed = now - reported;
    if (passed.count() < (frame != nullptr ? 1 : 2)) continue;
    if (frame == nullptr) {
      const std::string advice = client.status().advice();
      if (!context.json) {
        context.out << "no frames: " << (advice.empty() ? "dtactctl status says why" : advice)
                    << '\n';
      }
    } else if (context.json) {
      v1::Frame shown = *frame;
      if (shown.has_cloud()) shown.mutable_cloud()->clear_data();
      context.out << cli::json_line(shown);
    } else {
      context.out << watch_line(*frame, frames / passed.count());
    }
    context.out << std::flush;
    reported = now;
    frames = 0;
  }
}

}  // namespace

std::string watch_line(const v1::Frame& frame, double fps) {
  std::string line = fmt::format("{:.1f} fps", fps);
  if (!frame.has_contact()) {
    return line + (frame.contact_absence() == v1::CONTACT_ABSENCE_UNCALIBRATED
                       ? "  contact not measured: no calibration\n"
                       : "  contact not measured: the reference is being taken\n");
  }
  if (!frame.contact().in_contact()) return line + "  no contact\n";
  line += force_words(frame.contact());
  if (frame.has_recognition()) line += words_of(frame.recognition());
  if (frame.has_cloud()) {
    line += fmt::format("  {} points in {:.2f} ms", frame.cloud().points(),
                        frame.cloud().make_ns() * 1e-6);
  }
  if (frame.has_pose()) line += words_of(frame.pose());
  return line + "\n";
}

void add_watch(CLI::App& app, cli::Context& context) {
  auto* command = app.add_subcommand("watch",
                                     "Show a running dtact-perceive's rate, points, pose, "
                                     "recognised object and the force, a line a second, until "
                                     "Ctrl-C; without --port its own port, 7378");
  const auto seconds = std::make_shared<double>(0);
  command->add_option("--seconds", *seconds, "End by itself after so long")->check(cli::positive());
  cli::add_json_option(*command, context);
  command->callback([&app, &context, seconds] {
    if (app.count("--port") == 0) context.target.port = wire::kPerceivePort;
    watch(context, *seconds);
  });
}

}  // namespace dtact::perceive
