#include "clients/calibrate/guided_command.hpp"

#include <fmt/format.h>

#include <memory>
#include <utility>

#include "clients/calibrate/guided/console.hpp"
#include "clients/calibrate/guided/session.hpp"
#include "clients/common/exit_codes.hpp"
#include "clients/common/interruptible.hpp"
#include "clients/common/program.hpp"

namespace dtact::ctl {
namespace {

void run_guided(const cli::Context& context, guided::Plan plan) {
  const cli::Interruptible while_guiding;
  guided::LiveSensor sensor(context.target);
  const auto console = guided::make_console(context);
  try {
    if (guided::Session(sensor, *console, std::move(plan)).run() == guided::Outcome::unfinished) {
      throw cli::Failure(cli::kNotMet, "there is no calibration yet");
    }
  } catch (const guided::CaptureTimeout& e) {
    throw cli::Failure(cli::kNotMet, e.what());
  }
}

}  // namespace

void add_guided(CLI::App& app, cli::Context& context) {
  CLI::App* guided = app.add_subcommand(
      "guided",
      "Make a calibration in a session with the running daemon, from the undeformed surface over "
      "presses of a ball to the upload");
  const auto plan = std::make_shared<guided::Plan>();
  plan->folder = "dtact-calibration";
  guided->add_option("--radius-mm", plan->ball_radius_mm, "Radius of the ball, mm")
      ->required()
      ->check(cli::in_range(0.1, 100.0));
  add_map_options(*guided, plan->map);
  guided
      ->add_option("--presses", plan->presses,
                   "Number of presses after which the calibration is made, if they suffice")
      ->capture_default_str()
      ->check(CLI::Range(2, 99));
  guided
      ->add_option("--folder", plan->folder,
                   "Work folder: everything taken is saved there at once, and a session with the "
                   "same folder goes on; its name becomes the calibration's")
      ->type_name("FOLDER")
      ->capture_default_str();
  guided
      ->add_option("--patience", plan->timeout_s, "Seconds to wait for a surface that holds still")
      ->capture_default_str()
      ->check(cli::positive());
  const auto method = std::make_shared<std::string>("auto");
  guided->add_option("--method", *method, "How the LUT is made, as of dtact-calibrate depth")
      ->check(CLI::IsMember({"auto", "list", "model"}))
      ->capture_default_str();
  guided->add_flag("--force", plan->force,
                   "Make the calibration although LUT and ball disagree: a wrong scale or radius, "
                   "another light, a contact that is cut off");
  cli::add_json_option(*guided, context);
  guided->callback([&context, guided, plan, method] {
    plan->method = fit_method(*method);
    plan->again = cli::command_line(*guided);
    run_guided(context, *plan);
  });
}

}  // namespace dtact::ctl
