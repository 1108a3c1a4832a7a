#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

#include "hal/files/png.hpp"
#include "hal/sim/scene.hpp"

namespace dtact::accuracy {

/// A grey image of fractional levels, row-major.
struct Image {
  int width = 0;
  int height = 0;
  std::vector<double> pixels;

  /// Index of the pixel (column x, row y) in `pixels`.
  [[nodiscard]] std::size_t index(int x, int y) const {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(width) +
           static_cast<std::size_t>(x);
  }
};

/// Reference and pressed image, both of the same size.
struct BallPress {
  Image reference;
  Image ball;
};

/// Known properties of a real sensor without fitting: the published scale of its images
/// (shared/data/README.md).
struct Sensor {
  std::string name;
  double mm_per_px = 0;
};
inline const Sensor kSensorA = {"sensor_a", 0.0510};
inline const Sensor kSensorB = {"sensor_b", 0.0532};

/// A position in pixels.
struct Centre {
  double x = 0;
  double y = 0;
};

/// Mean darkening on rings about the centre.
struct Profile {
  static constexpr double kStep_mm = 0.2;
  /// Ring i reaches from i·kStep_mm to (i + 1)·kStep_mm; 45 rings are 0–9 mm.
  std::vector<double> change;
  double zero_mm = 0;  ///< Where the darkening turns into brightening.
  double ring_mm = 0;  ///< Where the brightening is greatest, ...
  double ring = 0;     ///< ... and the (negative) change there.

  [[nodiscard]] static double radius_mm(std::size_t ring_index) {
    return (static_cast<double>(ring_index) + 0.5) * kStep_mm;
  }
};

/// The folder's ball_reference.png and ball.png.
[[nodiscard]] BallPress read_real(const std::filesystem::path& folder);

/// The same two images from the simulator, each the mean of ten frames rounded to 8 bits, as the
/// real ones are. The scene's press begins at t = 1 s.
[[nodiscard]] BallPress simulate(const hal::sim::Scene& scene);
/// The scene's first frame only.
[[nodiscard]] Image simulate_frame(const hal::sim::Scene& scene);

/// Centroid of the darkening, weighted by the excess over five grey levels.
[[nodiscard]] Centre centroid(const BallPress& press);

[[nodiscard]] Profile radial_profile(const Image& change, const Centre& centre, double mm_per_px);
[[nodiscard]] Image change_of(const BallPress& press);

/// Root mean square of the difference of two profiles, grey levels.
[[nodiscard]] double rms_difference(const Profile& a, const Profile& b);

/// Standard deviation of an image minus its Gaussian blur of 2 px, grey
/// levels, without a border of 20 px.
[[nodiscard]] double high_pass_noise(const Image& image);

}  // namespace dtact::accuracy
