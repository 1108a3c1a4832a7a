#include "clients/calibrate/guided_command.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <unistd.h>

#include <iostream>
#include <memory>

#include "clients/calibrate/guided/json_console.hpp"
#include "clients/calibrate/guided/session.hpp"
#include "clients/common/exit_codes.hpp"
#include "clients/common/interruptible.hpp"

namespace dtact::ctl {
namespace {

/// The command that goes on with the work folder, for a shell.
std::string command_of(const cli::Context& context, const guided::Plan& plan) {
  const client::Options usual;
  std::string text = "dtact-calibrate";
  if (context.target.host != usual.host) text += " --host " + context.target.host;
  if (context.target.port != usual.port) text += fmt::format(" --port {}", context.target.port);
  text += fmt::format(" guided --radius-mm {}", plan.ball_radius_mm);
  if (!plan.map.lens.empty()) text += fmt::format(" --lens '{}'", plan.map.lens);
  if (plan.map.mm_per_px != 0) text += fmt::format(" --mm-per-px {}", plan.map.mm_per_px);
  if (!plan.map.centre.empty())
    text += fmt::format(" --centre {}", fmt::join(plan.map.centre, ","));
  if (!plan.map.crop.empty()) text += fmt::format(" --crop {}", fmt::join(plan.map.crop, ","));
  if (plan.force) text += " --force";
  return text + fmt::format(" --folder '{}'", plan.folder.string());
}

void run_guided(const cli::Context& context, guided::Plan plan) {
  plan.again = command_of(context, plan);
  const bool terminal =
      &context.out == &std::cout && ::isatty(STDOUT_FILENO) == 1 && ::isatty(STDIN_FILENO) == 1;
  const cli::Interruptible while_guiding;
  guided::LiveSensor sensor(context.target);
  const std::unique_ptr<guided::Console> console = [&]() -> std::unique_ptr<guided::Console> {
    if (context.json) {
      return std::make_unique<guided::JsonConsole>(STDIN_FILENO, context.out,
                                                   cli::Interruptible::happened);
    }
    return std::make_unique<guided::StreamConsole>(STDIN_FILENO, context.out, terminal,
                                                   cli::Interruptible::happened);
  }();
  try {
    if (guided::Session(sensor, *console, plan).run() == guided::Outcome::unfinished) {
      throw cli::Failure(cli::kNotMet, "there is no calibration yet");
    }
  } catch (const guided::NotTaken& e) {
    throw cli::Failure(cli::kNotMet, e.what());
  }
}

}  // namespace

void add_guided(CLI::App& app, cli::Context& context) {
  CLI::App* guided = app.add_subcommand(
      "guided",
      "Make a calibration in a session with the running daemon, from the untouched surface over "
      "presses of a ball to the upload");
  const auto plan = std::make_shared<guided::Plan>();
  plan->folder = "dtact-calibration";
  guided->add_option("--radius-mm", plan->ball_radius_mm, "Radius of the ball, mm")
      ->required()
      ->check(CLI::Range(0.1, 100.0));
  add_map_options(*guided, plan->map);
  guided
      ->add_option("--presses", plan->presses,
                   "After so many presses the calibration is made, where they suffice")
      ->capture_default_str()
      ->check(CLI::Range(2, 99));
  guided
      ->add_option("--folder", plan->folder,
                   "Work folder: everything taken is saved there at once, and a session with the "
                   "same folder goes on; its name becomes the calibration's")
      ->type_name("FOLDER")
      ->capture_default_str();
  guided
      ->add_option("--patience", plan->patience_s, "Seconds to wait for a surface that holds still")
      ->capture_default_str()
      ->check(CLI::PositiveNumber);
  const auto method = std::make_shared<std::string>("auto");
  guided->add_option("--method", *method, "How the list is made, as of dtact-calibrate depth")
      ->check(CLI::IsMember({"auto", "list", "model"}))
      ->capture_default_str();
  guided->add_flag("--force", plan->force,
                   "Make the calibration although list and ball disagree: a wrong scale or radius, "
                   "another light, a contact that is cut off");
  guided->callback([&context, plan, method] {
    plan->method = list_method(*method);
    run_guided(context, *plan);
  });
}

}  // namespace dtact::ctl
