#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace dtact::ctl {

/// One step of the light in the frames' mean grey, from the first frame that was exposed under the
/// new light according to the daemon.
class LightStep {
 public:
  enum class Verdict : std::uint8_t {
    going_on,
    settled,   ///< frames() is known.
    unseen,    ///< The mean stays as it was.
    restless,  ///< The mean does not come to rest.
    gap        ///< A frame is missing where it matters: the step is to be taken again.
  };

  /// `before_grey`: the mean grey at rest under the old light; `sequence`: the last frame's of it.
  LightStep(double before_grey, std::uint64_t sequence)
      : before_grey_(before_grey), before_(sequence) {}

  /// The next frame. `lit`: the ring showed the new light when its exposure began.
  [[nodiscard]] Verdict add(std::uint64_t sequence, bool lit, double mean_grey);

  /// Number of frames exposed under the new light that still showed some of the old one.
  [[nodiscard]] int frames() const noexcept { return frames_; }
  /// The mean grey at rest under the new light, once settled.
  [[nodiscard]] double grey() const noexcept { return grey_; }

  static constexpr std::size_t kRest = 8;  ///< Frames that the mean has to stay where it is.
  /// Smallest step, grey levels: noise and drift of the light reach less.
  static constexpr double kMinStep = 4;
  static constexpr std::size_t kMaxFrames = 120;

 private:
  struct Sample {
    std::uint64_t sequence;
    double grey;
  };
  [[nodiscard]] Verdict judge();

  double before_grey_;
  std::uint64_t before_;  // the last frame's under the old light
  std::vector<Sample> seen_;
  int frames_ = 0;
  double grey_ = 0;
};

}  // namespace dtact::ctl
