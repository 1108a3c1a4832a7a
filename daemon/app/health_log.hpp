#pragma once

#include <array>
#include <chrono>
#include <string>
#include <vector>

#include "daemon/pipeline/port.hpp"

namespace dtact::app {

/// What to log of the conditions under which depth deserves less trust: a line when one begins,
/// with what to do, and one when it is over. One that comes and goes is told once a minute, with
/// how often it came.
class HealthLog {
 public:
  using Time = std::chrono::steady_clock::time_point;
  static constexpr std::chrono::seconds kPause{60};

  struct Line {
    bool warning = false;
    std::string flag;  ///< Its name on the wire: "camera_fault".
    std::string text;
  };

  /// `reported`: what the log has been told already, by a line that knows more.
  explicit HealthLog(pipeline::HealthSet reported);
  /// The lines that are due, from what the pipeline says at `now`.
  [[nodiscard]] std::vector<Line> step(const pipeline::Status& status, Time now);

 private:
  struct Condition {
    bool known = false;  ///< The log has been told that it is about to begin.
    bool on = false;
    bool reported = false;  ///< That it began, and not yet that it is over.
    unsigned times = 0;     ///< It began, untold.
    Time last = Time::min();
  };
  std::array<Condition, pipeline::kHealthCount> health_flags_{};
};

}  // namespace dtact::app
