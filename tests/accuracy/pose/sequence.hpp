#pragma once

#include <cstdint>
#include <random>
#include <string>
#include <vector>

#include "clients/perceive/geometry/point_cloud.hpp"
#include "clients/perceive/pose/alignment.hpp"
#include "hal/sim/truth.hpp"

namespace dtact::pose {

/// How an object that is pressed 0.5 mm into the layer moves within two seconds.
struct Way {
  const char* name;
  double slide_mm = 0;   ///< To the right.
  double twist_deg = 0;  ///< About the surface's normal.
  double roll_deg = 0;   ///< About the vertical of the picture.
  double deeper_mm = 0;
};
inline constexpr Way kSlide{.name = "slide", .slide_mm = 4};
inline constexpr Way kTwist{.name = "twist", .twist_deg = 30};
inline constexpr Way kRoll{.name = "roll", .roll_deg = 15};
inline constexpr Way kDeeper{.name = "deeper", .deeper_mm = 0.3};

/// The keys of a press, as in a scene's file, that go this way in so many steps. The layer is
/// solved at keys; between them two solutions are blended, which is no shape of an object: look at
/// the frames of the keys.
[[nodiscard]] std::string keys_of(const Way& way, int steps);
/// Keys of a minute: slid to and fro along a cross and twisted, again and again.
[[nodiscard]] std::string keys_of_a_minute(int steps);

/// Fingers of 30 mm of radius whose tips are 28 mm before the camera.
inline const recon::Surface kSphere{recon::Surface::Kind::sphere, 30, 0, 20, 8, 1};
inline const recon::Surface kCylinder{recon::Surface::Kind::cylinder, 30, 0, 20, 8, 1};

/// Indentation, whole micrometres, cut out around what is pressed.
struct Map {
  std::vector<std::int16_t> values;
  perceive::DepthGrid grid;  ///< Of `values`.
};

/// The layer's true indentation with noise while an object moves: what the mechanics of a soft
/// layer do to a shape, without the errors of a calibration.
class Sequence {
 public:
  static constexpr int kFps = 60;
  static constexpr double kNoiseUm = 3;

  /// `object`: the lines of a scene's press that say what it is. A cylinder `surface` lies along x,
  /// and rays are straight (refraction 1), as in the simulator.
  Sequence(const std::string& object, const std::string& keys, const recon::Surface& surface = {});

  /// The map of a frame, of no values where nothing is pressed any more; `noise_um`: the deviation
  /// of its noise, another with every call.
  [[nodiscard]] Map map(std::uint64_t sequence, double noise_um = kNoiseUm);
  /// What has happened to the object's points since the first frame, metres.
  [[nodiscard]] perceive::Motion motion(std::uint64_t sequence) const;
  /// From the object's own frame to the surface frame, metres.
  [[nodiscard]] perceive::Motion place(std::uint64_t sequence) const;
  [[nodiscard]] const hal::sim::Object& object() const {
    return truth_.scene().presses.at(0).object;
  }

 private:
  hal::sim::Truth truth_;
  std::mt19937 random_{1};
  std::vector<float> mm_;
};

}  // namespace dtact::pose
