#include "tests/e2e/sensor.hpp"

#include <algorithm>
#include <csignal>
#include <stdexcept>
#include <utility>

#include "tests/e2e/patience.hpp"

namespace dtact::e2e {
namespace {

namespace fs = std::filesystem;

void run_or_throw(const std::vector<std::string>& command) {
  std::string output;
  if (run_program(command, &output) != 0) throw std::runtime_error(command[0] + ":\n" + output);
}

/// No contact until frame 120 of the scene, pressed and still from frame 180 on.
void calibrate(const fs::path& folder, const fs::path& calibration) {
  const std::string scene = scene_file("calibrate_ball.toml").string();
  const std::string reference = (folder / "reference").string();
  const std::string ball = (folder / "ball").string();
  run_or_throw({SIM_RENDER_PROGRAM, "--scene", scene, "--frames", "0:32", "-o", reference});
  run_or_throw({SIM_RENDER_PROGRAM, "--scene", scene, "--frames", "200:232", "-o", ball});
  run_or_throw({CALIBRATE_PROGRAM, "depth", "--reference", reference, "--ball", ball, "--radius-mm",
                "4.0", "--mm-per-px", "0.0413793", "--centre", "400,300", "--crop", kCrop, "-o",
                calibration.string()});
}

}  // namespace

fs::path scene_file(const std::string& name) {
  return fs::path(DTACT_SOURCE_DIR) / "config/scenes" / name;
}

const fs::path& calibration_folder() {
  static const TempFolder folder;
  static const fs::path made = [] {
    fs::path calibration = folder.path() / "calibration";
    calibrate(folder.path(), calibration);
    return calibration;
  }();
  return made;
}

Sensor::Sensor(const fs::path& scene, bool calibrated, const std::vector<std::string>& settings,
               Environment daemon_environment, std::optional<client::Tls> clients_tls)
    : environment(std::move(daemon_environment)), tls(std::move(clients_tls)) {
  arguments = {"--set", "net.port=0", "--set", "state_dir=" + (folder.path() / "state").string()};
  const auto set = [&](const std::string& setting) {
    arguments.insert(arguments.end(), {"--set", setting});
  };
  if (!scene.empty()) set("camera.sim.scene=" + scene.string());
  // The simulated sensor's own may be installed on this machine.
  set(calibrated ? "calibration=" + calibration_folder().string() : "camera.sim.calibration=");
  for (const std::string& setting : settings) set(setting);
  daemon = std::make_unique<DaemonProcess>(arguments, environment);
}

client::Options Sensor::options() const {
  client::Options options;
  options.port = daemon->port();
  options.tls = tls;
  return options;
}

client::Client Sensor::connect(const std::string& program) const {
  client::Options wanted = options();
  wanted.program = program;
  wanted.timeout = std::chrono::seconds(20);
  return client::Client(wanted);
}

void Sensor::restart() {
  if (daemon->stop(SIGTERM) != 0) throw std::runtime_error("the daemon ended badly");
  daemon = std::make_unique<DaemonProcess>(arguments, environment);
}

bool read_until(client::Client& client, const std::function<bool(const Item&)>& done,
                std::chrono::seconds patience) {
  const auto deadline = std::chrono::steady_clock::now() + kSlower * patience;
  while (std::chrono::steady_clock::now() < deadline) {
    const auto item = client.next(std::chrono::milliseconds(500));
    if (item && done(*item)) return true;
  }
  return false;
}

bool has(const google::protobuf::RepeatedField<int>& health, v1::Health flag) {
  return std::ranges::find(health, flag) != health.end();
}

}  // namespace dtact::e2e
