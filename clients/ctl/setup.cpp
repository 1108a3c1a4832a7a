// dtactctl setup: from a plugged-in camera to depth, by the programs that do each step.
#include <fcntl.h>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <spawn.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <iostream>
#include <memory>
#include <string>
#include <system_error>
#include <thread>
#include <utility>
#include <vector>

#include "clients/common/exit_codes.hpp"
#include "clients/common/interruptible.hpp"
#include "clients/common/printable.hpp"
#include "clients/common/sibling_program.hpp"
#include "clients/cpp/client.hpp"
#include "clients/ctl/online.hpp"
#include "clients/ctl/setup_plan.hpp"
#include "hal/base/atomic_file.hpp"
#include "hal/base/unique_fd.hpp"
#include "hal/base/utf8.hpp"
#include "hal/files/key_reader.hpp"

namespace dtact::ctl {
namespace {

namespace fs = std::filesystem;
using Command = std::vector<std::string>;

constexpr const char* kBoards = "/usr/share/doc/dtactd/examples/boards";
constexpr const char* kSimulated = "sim";
const std::vector<std::string> kSetupSteps = {"camera", "check", "restart", "calibrate", "watch"};

struct SetupOptions {
  std::vector<std::string> steps;  ///< Empty: all.
  std::string unit = "dtactd";
  std::string config;  ///< Empty: the unit's.
  std::string camera;
  std::string mode;
  std::string board;
  std::string folder;  ///< Empty: chosen.
  std::string radius_mm;
  std::string mm_per_px;
  std::string ruler;
  std::string lens;
  std::string crop;
};

/// A file beside another, which is removed at the end.
class TrialFile {
 public:
  /// Throws std::system_error.
  explicit TrialFile(const std::string& beside) : path_(beside + ".XXXXXX") {
    const base::UniqueFd fd(::mkostemp(path_.data(), O_CLOEXEC));
    if (!fd) throw std::system_error(errno, std::generic_category(), path_);
  }
  ~TrialFile() {
    std::error_code ignored;
    fs::remove(path_, ignored);
  }
  TrialFile(const TrialFile&) = delete;
  TrialFile& operator=(const TrialFile&) = delete;

  [[nodiscard]] const std::string& path() const { return path_; }

 private:
  std::string path_;
};

/// Runs a program on this terminal. Returns its exit status. Throws when it is not there.
int run_program(const Command& command, std::ostream& out) {
  out << "$ " << fmt::format("{}", fmt::join(command, " ")) << '\n' << std::flush;
  std::vector<char*> arguments;
  for (const std::string& argument : command) {
    arguments.push_back(const_cast<char*>(argument.c_str()));
  }
  arguments.push_back(nullptr);
  const cli::Interruptible while_it_runs;  // Ctrl-C is the program's
  pid_t child = 0;
  if (const int error =
          ::posix_spawnp(&child, arguments[0], nullptr, nullptr, arguments.data(), environ)) {
    throw std::runtime_error(fmt::format("cannot run {}: {}", command[0], std::strerror(error)));
  }
  int status = 0;
  while (::waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
}

class Setup {
 public:
  Setup(const Context& context, const CLI::App& command, SetupOptions options)
      : context_(context),
        command_(command),
        options_(std::move(options)),
        target_(context.target),
        target_words_(cli::given_options(*command.get_parent())) {
    if (options_.config.empty()) {
      const std::size_t at = options_.unit.find('@');
      options_.config = fmt::format(
          "/etc/dtactd/{}.toml", at == std::string::npos ? "dtactd" : options_.unit.substr(at + 1));
    }
    const auto given = [this](const char* option) {
      return std::ranges::find(target_words_, option) != target_words_.end();
    };
    if (given("--host") || given("--port")) return;
    // The unit's own daemon: others may listen on the usual port.
    const DaemonTarget own =
        target_of(base::read_file(options_.config), options_.unit, options_.config);
    if (!own.host.empty()) {
      target_.host = own.host;
      target_words_.insert(target_words_.end(), {"--host", own.host});
    }
    if (!own.port.empty()) {
      target_.port = static_cast<std::uint16_t>(std::stoi(own.port));
      target_words_.insert(target_words_.end(), {"--port", own.port});
    }
  }

  void run() {
    const bool all = options_.steps.empty();
    left_ = all ? kSetupSteps : options_.steps;
    for (; !left_.empty(); left_.erase(left_.begin())) {
      const std::string& step = left_.front();
      context_.out << fmt::format("\n{} of {}: {}\n", number_of(step), kSetupSteps.size(), step);
      if (step == "camera") set_camera();
      if (step == "check") check();
      if (step == "restart") restart();
      if (step == "calibrate" && !(all && calibrated())) calibrate();
      if (step == "watch") watch();
    }
  }

 private:
  static std::ptrdiff_t number_of(const std::string& step) {
    return std::ranges::find(kSetupSteps, step) - kSetupSteps.begin() + 1;
  }

  /// Ends the command; gives the command line for the steps that are left.
  [[noreturn]] void stop(const std::string& what) const {
    throw cli::Failure(cli::kNotMet,
                       fmt::format("{}; then continue with: {} {}", what,
                                   cli::command_line(command_), fmt::join(left_, " ")));
  }

  /// A line typed here; empty when nothing can be. Byte by byte: the rest is the next program's.
  [[nodiscard]] std::string ask(const std::string& question) const {
    context_.out << question << std::flush;
    std::string line;
    for (char c = 0; ::read(STDIN_FILENO, &c, 1) == 1 && c != '\n';) line += c;
    return line;
  }

  // 1: the configuration
  // ----------------------------------------------------------------------------

  void set_camera() {
    const std::string before = base::read_file(options_.config);
    const Settings old = settings_of(before, options_.config);
    Settings wanted = board_settings();
    if (options_.camera == kSimulated) {
      wanted = {{"camera.backend", "\"sim\""}, {"ring.backend", "\"sim\""}};
    } else if (value_of(wanted, "camera.backend") != "\"libcamera\"") {
      add_usb_camera(wanted);
      // The simulated ring lights no real sensor.
      const std::string ring = value_of(wanted, "ring.backend", value_of(old, "ring.backend"));
      if (ring.empty() || ring == "\"sim\"") {
        assign(wanted, "ring.backend", "\"null\"");
        context_.out << "ring: none that this computer commands; for one see [ring] in "
                     << options_.config << '\n';
      }
    }
    write(before, old, wanted);
  }

  /// What the board's configuration sets, the network aside.
  [[nodiscard]] Settings board_settings() const {
    std::string board = options_.board;
    if (board.empty()) {
      std::string model;
      if (fs::exists("/proc/device-tree/model")) model = base::read_file("/proc/device-tree/model");
      board = board_of(model);
      if (board.empty()) return {};
      context_.out << "board: " << model.c_str() << '\n';
    }
    const fs::path file =
        board.ends_with(".toml") ? fs::path(board) : fs::path(kBoards) / (board + ".toml");
    context_.out << "settings of the board: " << file.string() << '\n';
    Settings settings = settings_of(base::read_file(file), file.string());
    std::erase_if(settings, [](const Setting& each) { return each.key.starts_with("net."); });
    return settings;
  }

  void add_usb_camera(Settings& wanted) const {
    std::vector<hal::v4l2::SurveyedCamera> cameras = hal::v4l2::survey_cameras();
    const bool named = !options_.camera.empty();
    std::erase_if(cameras, [&](const hal::v4l2::SurveyedCamera& camera) {
      const hal::v4l2::Attached& who = camera.attached;
      // Another node of the same camera has its serial and bus, and delivers no frames.
      if (!who.not_taken.empty()) return !named || options_.camera != who.node;
      return named && options_.camera != who.stable_name() && options_.camera != who.by_id &&
             options_.camera != who.node && options_.camera != "serial:" + who.serial &&
             options_.camera != "bus:" + who.bus;
    });
    if (cameras.empty()) {
      stop(named ? fmt::format("no camera {} is attached: dtactctl cameras lists those that are",
                               options_.camera)
                 : "no USB camera is attached: plug it in; for a CSI camera add "
                   "--board raspberry-pi-5-csi-spi");
    }
    const hal::v4l2::SurveyedCamera& camera = cameras[choose(cameras)];
    if (!camera.attached.problem.empty()) stop(camera.attached.problem);
    const auto best = options_.mode.empty() ? best_mode(camera.modes) : parse_mode(options_.mode);
    if (!best)
      stop("the camera delivers no format that dtactd reads: dtactctl cameras lists its modes");
    const bool offered = std::ranges::any_of(camera.modes, [&](const hal::v4l2::Mode& mode) {
      return mode.usable() && mode.offers(best->width, best->height, best->fps);
    });
    if (!offered && !options_.mode.empty()) {
      stop(fmt::format("the camera has no mode {}; it has {}", options_.mode,
                       hal::v4l2::describe(camera.modes)));
    }
    context_.out << fmt::format("camera: {} ({}), {}; --mode takes another of {}\n",
                                base::printable(camera.attached.stable_name()),
                                base::printable(camera.attached.card), text_of(*best),
                                hal::v4l2::describe(camera.modes));
    assign(wanted, "camera.backend", "\"v4l2\"");
    assign(wanted, "camera.width", std::to_string(best->width));
    assign(wanted, "camera.height", std::to_string(best->height));
    assign(wanted, "camera.fps", fmt::format("{:.2f}", best->fps));
    // "" follows the only camera to another port.
    const bool only = !named && cameras.size() == 1;
    assign(wanted, "camera.v4l2.device",
           tomlfile::quoted(only ? "" : camera.attached.stable_name()));
  }

  [[nodiscard]] std::size_t choose(const std::vector<hal::v4l2::SurveyedCamera>& cameras) const {
    if (cameras.size() == 1) return 0;
    for (std::size_t i = 0; i < cameras.size(); ++i) {
      context_.out << fmt::format("  {}  {} ({})\n", i + 1,
                                  base::printable(cameras[i].attached.stable_name()),
                                  base::printable(cameras[i].attached.card));
    }
    const std::string typed = ask("Which camera looks at the gel? Its number: ");
    for (std::size_t i = 0; i < cameras.size(); ++i) {
      if (typed == std::to_string(i + 1)) return i;
    }
    stop("several cameras are attached: type the number of one, or name it by --camera");
  }

  static std::string value_of(const Settings& settings, const std::string& key,
                              const std::string& otherwise = "") {
    const auto found = std::ranges::find(settings, key, &Setting::key);
    return found == settings.end() ? otherwise : found->value;
  }
  static void assign(Settings& settings, const std::string& key, const std::string& value) {
    std::erase_if(settings, [&](const Setting& each) { return each.key == key; });
    settings.push_back({key, value});
  }

  /// Replaces the configuration by one that dtactd accepts.
  void write(const std::string& before, const Settings& old, const Settings& wanted) const {
    const std::string after = with_settings(before, wanted, options_.config);
    const Settings fresh = settings_of(after, options_.config);
    for (const Setting& setting : wanted) {
      const std::string was = value_of(old, setting.key, "not set");
      const std::string is = value_of(fresh, setting.key);
      if (was != is) context_.out << fmt::format("  {} = {} (was {})\n", setting.key, is, was);
    }
    if (after == before) {
      context_.out << options_.config << " has these settings already\n";
      return;
    }
    struct stat about{};
    if (::stat(options_.config.c_str(), &about) != 0 ||
        ::access(options_.config.c_str(), W_OK) != 0) {
      stop(fmt::format("cannot write {} ({}): run it by sudo", options_.config,
                       std::strerror(errno)));
    }
    const TrialFile trial(options_.config);
    base::write_file_atomically(trial.path(), after, about.st_mode & 0777U);
    if (run_program({cli::sibling("dtactd"), "--config", trial.path(), "--check-config"},
                    context_.out) != 0) {
      stop("dtactd refuses these settings, nothing is written: see above");
    }
    base::write_file_atomically(options_.config, after, about.st_mode & 0777U);
    // The daemon's group reads it.
    if (::chown(options_.config.c_str(), about.st_uid, about.st_gid) != 0) {
      stop(fmt::format("{} is written, but its owner could not be restored ({}): run it by sudo",
                       options_.config, std::strerror(errno)));
    }
    context_.out << options_.config << " is written\n";
  }

  // 2 to 5: the programs
  // ----------------------------------------------------------------------------

  void check() const {
    const std::string dtactd = cli::sibling("dtactd");
    if (run_program({dtactd, "--config", options_.config, "--check-config"}, context_.out) != 0 ||
        run_program({dtactd, "--config", options_.config, "--doctor"}, context_.out) != 0) {
      stop("fix what is marked WRONG above");
    }
  }

  void restart() const {
    if (run_program({"systemctl", "restart", options_.unit}, context_.out) != 0) {
      stop(fmt::format("the service does not start: systemctl status {} says why", options_.unit));
    }
    const v1::Status status = wait_for_camera();
    context_.out << fmt::format("the service runs: camera {}, {}x{} at {:g} fps\n",
                                status.camera().identity(), status.camera().width(),
                                status.camera().height(), status.camera().fps());
  }

  /// The daemon's status once it gets frames.
  [[nodiscard]] v1::Status wait_for_camera() const {
    std::string why;
    const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(30);
    while (std::chrono::steady_clock::now() < deadline) {
      try {
        v1::Status status = client::Client(target_).status();
        if (status.camera().delivered() > 0 && status.state() != v1::STATE_CAMERA_LOST) {
          return cli::printable(std::move(status));
        }
        why = status.advice();
      } catch (const client::IdentityError&) {
        throw;
      } catch (const client::Refused& e) {
        if (e.code() == v1::ERROR_DENIED) throw;
        why = e.what();
      } catch (const client::Error& e) {
        why = e.what();
      }
      std::this_thread::sleep_for(std::chrono::milliseconds(200));
    }
    stop("the daemon gets no frames: " + why);
  }

  /// Whether the calibration that is there may stay.
  [[nodiscard]] bool calibrated() const {
    const v1::Status status = wait_for_camera();
    const auto& health = status.health();
    if (!status.has_calibration() ||
        std::ranges::find(health, v1::HEALTH_CAMERA_MISMATCH) != health.end()) {
      return false;
    }
    context_.out << fmt::format(
        "{} is calibrated, by {}; dtactctl setup calibrate makes another one\n",
        status.camera().identity(), status.calibration().name());
    return true;
  }

  /// Where guided goes on with a session that ended early. One that has its calibration is not
  /// taken up again: its presses are of the gel of that time.
  [[nodiscard]] std::string work_folder() const {
    if (!options_.folder.empty()) return options_.folder;
    std::string name = "dtact-calibration";
    if (const std::size_t at = options_.unit.find('@'); at != std::string::npos) {
      name += "-" + options_.unit.substr(at + 1);
    }
    std::string folder = name;
    for (int i = 2; std::filesystem::exists(std::filesystem::path(folder) / "calibration"); ++i) {
      folder = fmt::format("{}-{}", name, i);
    }
    return folder;
  }

  void calibrate() const {
    Command command = {cli::sibling("dtact-calibrate")};
    add_target(command);
    command.emplace_back("guided");
    const std::string folder = work_folder();
    command.insert(command.end(), {"--folder", folder});
    const auto add = [&command](const std::string& option, const std::string& value) {
      if (!value.empty()) command.insert(command.end(), {option, value});
    };
    const auto asked = [this](const std::string& given, const std::string& question) {
      const std::string value = given.empty() ? ask(question) : given;
      if (value.empty()) stop("give --radius-mm, and --mm-per-px, --ruler or --lens");
      return value;
    };
    add("--radius-mm", asked(options_.radius_mm, "Radius of the ball that you press in, mm: "));
    if (options_.lens.empty() && options_.ruler.empty()) {
      const std::string scale =
          asked(options_.mm_per_px,
                "Scale of the picture, mm per pixel. Or, of a ruler or coin that you press in, "
                "X,Y,X,Y,MM: two points in the picture of dtactctl snapshot --luma and their "
                "distance: ");
      add(scale.find(',') == std::string::npos ? "--mm-per-px" : "--ruler", scale);
    }
    if (!options_.lens.empty()) add("--mm-per-px", options_.mm_per_px);
    add("--ruler", options_.ruler);
    add("--lens", options_.lens);
    add("--crop", options_.crop);
    const std::string made = folder + "/calibration";
    // An earlier session's may lie there, and an interrupted one makes it anew.
    const auto written = [&made] {
      std::error_code absent;
      return fs::last_write_time(made, absent);
    };
    const fs::file_time_type before = written();
    if (run_program(command, context_.out) == 0) return;
    if (written() != before) {
      Command upload = {"dtactctl"};
      add_target(upload);
      upload.insert(upload.end(), {"calibration", "upload", made});
      throw cli::Failure(cli::kNotMet,
                         fmt::format("{} is made but not in use; put it in use with: {}", made,
                                     fmt::join(upload, " ")));
    }
    stop(fmt::format("no calibration was made; what was taken is in {} (--folder: another one)",
                     folder));
  }

  void watch() const {
    Command command = {cli::sibling("dtactctl")};
    add_target(command);
    const bool terminal = &context_.out == &std::cout && ::isatty(STDOUT_FILENO) == 1;
    command.emplace_back("watch");
    if (terminal) {
      command.emplace_back("--draw");
    } else {
      command.insert(command.end(), {"--seconds=5", "--min-fps=0.5"});
    }
    if (run_program(command, context_.out) != 0) stop("no depth came: dtactctl status says why");
  }

  void add_target(Command& command) const {
    command.insert(command.end(), target_words_.begin(), target_words_.end());
  }

  const Context& context_;
  const CLI::App& command_;
  SetupOptions options_;
  client::Options target_;                 // the unit's daemon
  std::vector<std::string> target_words_;  // the same as options of the other programs
  std::vector<std::string> left_;          // steps, the present one first
};

}  // namespace

void add_setup(CLI::App& app, Context& context) {
  auto* command = app.add_subcommand(
      "setup",
      "Guide from a plugged-in camera to depth: camera (finds it and writes the configuration, "
      "comments kept), check (dtactd --doctor), restart (of the service), calibrate "
      "(dtact-calibrate "
      "guided), watch");
  const auto options = std::make_shared<SetupOptions>();
  command->add_option("step", options->steps, "Only these steps, in this order (default: all)")
      ->check(CLI::IsMember(kSetupSteps));
  command->add_option("--unit", options->unit, "The service, as dtactd@left")
      ->capture_default_str();
  command->add_option("--config", options->config, "Its configuration (default: in /etc/dtactd)")
      ->type_name("FILE");
  command
      ->add_option("--camera", options->camera,
                   "A name that dtactctl cameras prints, or sim for the simulated sensor "
                   "(default: the only USB camera)")
      ->type_name("NAME");
  command
      ->add_option("--mode", options->mode,
                   "Size and rate, as 800x600@60 (default: nearest to that)")
      ->type_name("WxH@FPS");
  command
      ->add_option("--board", options->board,
                   "Board's configuration whose camera and ring are taken: a file, or a name in "
                   "/usr/share/doc/dtactd/examples/boards (default: of the board that this is)")
      ->type_name("NAME");
  command
      ->add_option("--folder", options->folder,
                   "Where calibrate keeps what it takes, and goes on after an early end (default: "
                   "dtact-calibration here)")
      ->type_name("DIR");
  command
      ->add_option("--radius-mm", options->radius_mm,
                   "See dtact-calibrate guided; asked for if not given")
      ->type_name("MM");
  command
      ->add_option("--mm-per-px", options->mm_per_px,
                   "See dtact-calibrate guided; asked for if not given")
      ->type_name("MM");
  command->add_option("--ruler", options->ruler, "See dtact-calibrate guided")
      ->type_name("X,Y,X,Y,MM");
  command->add_option("--lens", options->lens, "See dtact-calibrate guided")->type_name("FILE");
  command->add_option("--crop", options->crop, "See dtact-calibrate guided")->type_name("W,H");
  command->callback([&context, command, options] { Setup(context, *command, *options).run(); });
}

}  // namespace dtact::ctl
