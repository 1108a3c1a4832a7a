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

/// The settings from the command line.
struct Plan {
  std::filesystem::path folder;  ///< The work folder.
  double ball_radius_mm = 0;
  MapOptions map;
  int presses = 6;  ///< Presses after which the calibration is made, if they suffice.
  int reference_frames = 32;
  int press_frames = 16;
  double timeout_s = 60;  ///< Limit of each capture.
  bool force = false;     ///< Accepts a doubtful LUT, too.
  FitMethod method = FitMethod::automatic;
  std::string again;  ///< The command line that continues the work folder, for a shell.
};

enum class Outcome {
  uploaded,    ///< The daemon uses the calibration.
  kept,        ///< It was made and, on request, not uploaded.
  unfinished,  ///< The user or the input ended the session before.
};

/// The guided calibration: reference, presses, LUT, upload. Each is saved in the work folder as
/// soon as it is captured, so another session can continue at any point.
class Session {
 public:
  /// Throws std::runtime_error when the work folder cannot be made.
  Session(Sensor& sensor, Console& console, Plan plan);

  /// Throws std::runtime_error with a fix when the daemon is not ready, a capture fails without a
  /// user to fix it, or camera or light changed since the work folder was begun;
  /// client::Error like the sensor.
  [[nodiscard]] Outcome run();

 private:
  [[nodiscard]] Outcome guide();
  void greet();
  void prepare_map(const v1::Status& status);
  void resume();
  /// The daemon's state, after a wait where it is unfit: a camera with a passing fault recovers by
  /// itself.
  [[nodiscard]] v1::Status steady_status();
  /// Throws unless camera and light are those of the reference.
  void require_same_sensor();
  void load();
  [[nodiscard]] std::string ask(const Prompt& prompt);

  void reference_step();
  /// Captures presses until there is a LUT and the user, or the number of presses, ends it.
  void press_steps();
  [[nodiscard]] Prompt press_prompt() const;
  void take_press(const std::string& name);
  void judge();
  /// Makes the calibration with the chosen method, once for the present presses; returns
  /// whether it succeeded. If not, coverage_.missing has the reason.
  [[nodiscard]] bool make();
  /// Saves the calibration and offers the upload; an end of the session there means no.
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
  CellMeans last_;  ///< The last press.
  Coverage coverage_;
  std::optional<bool> made_;  ///< Result of make().
};

}  // namespace dtact::ctl::guided
