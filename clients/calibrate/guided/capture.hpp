#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "clients/calibrate/guided/cells.hpp"
#include "clients/calibrate/guided/console.hpp"
#include "clients/calibrate/guided/sensor.hpp"
#include "hal/files/png.hpp"

namespace dtact::ctl::guided {

/// Frames of a surface that stood still.
struct SteadyFrames {
  std::vector<image::Grey8> frames;
  CellMeans cells;          ///< Mean of all frames.
  double drift_levels = 0;  ///< The largest change of a cell from the first half to the last.
  double noise_levels = 0;  ///< Standard deviation of a pixel from frame to frame.
};

/// The user or the input ended the session.
struct Ended {
  enum class Why { quit, input, interrupt };
  Why why = Why::quit;
};

/// Frames could not be taken in time; what() names the reason.
class CaptureTimeout : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// There was contact when the reference was taken: the surface is brighter there now.
struct ReferenceInContact {};

/// A frame and its cells.
struct ObservedFrame {
  image::Grey8 image;
  std::int64_t time_ns = 0;  ///< Time of capture on the daemon's clock.
  CellMeans cells;
};

/// Watches the sensor's frames and takes some while they stand still. It uses the
/// frames' contents and their own times, so that a faster or slower sensor gives the same.
class Capture {
 public:
  struct Rules {
    double timeout_s = 60;  ///< In the frames' times; then throws CaptureTimeout.
  };
  /// Calls `shown` with each usable frame and a short description.
  Capture(Sensor& sensor, Console& console, const CellGrid& grid, const Rules& rules,
          std::function<void(const ObservedFrame&, const std::string&)> shown);

  /// Frames must have this light from now on (r, g, b of each LED after brightness).
  void expect_light(std::vector<std::uint8_t> leds) { leds_ = std::move(leds); }

  /// The next usable frame; null when no frame came in 100 ms or it cannot be used. Throws Ended on
  /// Ctrl-C, std::runtime_error when the light is another.
  [[nodiscard]] const ObservedFrame* next();

  /// Waits for `count` consecutive still frames. Throws CaptureTimeout, Ended and like next().
  [[nodiscard]] SteadyFrames reference(int count);
  /// Waits for an object in contact, at another position or depth than in `last` (empty: none), and
  /// captures it. Enter typed meanwhile captures the press as it is. Throws
  /// ReferenceInContact too.
  [[nodiscard]] SteadyFrames press(int count, const CellMeans& reference, const CellMeans& last);

 private:
  /// Objection to a frame; empty: none.
  using Objection = std::function<std::string(const ObservedFrame&)>;
  /// `forcible`: Enter typed meanwhile takes the present frames.
  [[nodiscard]] SteadyFrames hold(int count, bool forcible, const Objection& objection);
  [[nodiscard]] std::string trouble();
  /// Whether a waiting user typed Enter alone; tells them that other words have no meaning here.
  /// Throws Ended.
  [[nodiscard]] bool enter_typed();

  Sensor& sensor_;
  Console& console_;
  const CellGrid& grid_;
  Rules rules_;
  std::function<void(const ObservedFrame&, const std::string&)> shown_;
  std::vector<std::uint8_t> leds_;
  ObservedFrame observed_;
  /// Time of the frame that next() read, usable or not; empty: none came.
  std::optional<std::int64_t> read_ns_;
};

}  // namespace dtact::ctl::guided
