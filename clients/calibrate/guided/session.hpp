#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "clients/calibrate/guided/capture.hpp"
#include "clients/calibrate/guided/coverage.hpp"
#include "clients/calibrate/guided/live_view.hpp"
#include "clients/calibrate/guided/work_folder.hpp"
#include "clients/calibrate/offline/depth_build.hpp"

namespace dtact::ctl::guided {

/// What the command line asks for.
struct Plan {
  std::filesystem::path folder;  ///< The work folder.
  double ball_radius_mm = 0;
  MapOptions map;
  int presses = 6;  ///< Presses after which the calibration is made, if they suffice.
  int reference_frames = 32;
  int press_frames = 16;
  double timeout_s = 60;  ///< For each take.
  bool force = false;     ///< A doubtful LUT is taken, too.
  FitMethod method = FitMethod::automatic;
  std::string again;  ///< The command line that goes on with the work folder, for a shell.
};

enum class Outcome {
  uploaded,    ///< The daemon uses the calibration.
  kept,        ///< It was made and, as the user wished, not uploaded.
  unfinished,  ///< The user or the input ended the session before there was one.
};

/// The guided calibration: reference, presses, LUT, upload. Each is saved in the work folder as
/// soon as it is taken, so another session can continue at any point.
class Session {
 public:
  /// Throws std::runtime_error when the work folder cannot be made.
  Session(Sensor& sensor, Console& console, Plan plan);

  /// Throws std::runtime_error with a fix when the daemon is not ready, a capture fails without a
  /// user to fix it, or camera or light changed since the work folder was begun;
  /// client::Error as the sensor does.
  [[nodiscard]] Outcome run();

 private:
  [[nodiscard]] Outcome guide();
  void greet();
  void prepare_map(const v1::Status& status);
  void resume();
  /// The daemon's state, after a while where it is unfit: a camera that stumbles comes back by
  /// itself.
  [[nodiscard]] v1::Status steady_status();
  /// Throws unless camera and light are those of the reference.
  void require_same_sensor();
  void load();
  [[nodiscard]] std::string ask(const Prompt& prompt);

  void reference_step();
  /// Until there is a LUT and the user, or the number of presses, says that it is enough.
  void press_steps();
  [[nodiscard]] Prompt press_prompt() const;
  void take_press(const std::string& name);
  void judge();
  /// Makes the calibration by the method that was asked for, once for the presses that there are;
  /// whether there is one. If not, coverage_.missing says why.
  [[nodiscard]] bool make();
  [[nodiscard]] Outcome finish();
  void upload();

  Sensor& sensor_;
  Console& console_;
  Plan plan_;
  WorkFolder folder_;
  LiveView view_;
  CellGrid grid_;
  double cell_mm_ = 0;
  std::unique_ptr<Capture> capture_;
  PressImages images_;
  calibration::Calibration empty_;  ///< The map and the reference, without a LUT.
  CellMeans reference_;
  CellMeans last_;  ///< The press taken last.
  Coverage coverage_;
  std::optional<bool> made_;  ///< What make() came to.
};

}  // namespace dtact::ctl::guided
