#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "hal/sim/objects.hpp"
#include "hal/sim/surface.hpp"

namespace dtact::hal::sim {

/// What the scene file's tables mean is documented in config/scenes/default.toml, once.
struct CameraModel {
  int width = 0;   ///< Pixels.
  int height = 0;  ///< Pixels.
  double fps = 0;
  double mm_per_px = 0;  ///< On the gel, at the image's centre.
  double barrel = 0;
  double exposure = 0;
  double gamma = 0;
  double read_noise = 0;
  double shot_noise = 0;
  int light_delay_frames = 0;
};

/// Millimetres. Objects press at most 0.9 of the thickness, and Truth holds indentations up
/// to 4.09.
inline constexpr double kMinThicknessMm = 0.5;
inline constexpr double kMaxThicknessMm = 4.5;

struct GelModel {
  double thickness_mm = 0;
  double youngs_modulus_mpa = 0;
  double poisson = 0.5;
  double grid_mm = 0;
  double solve_step_mm = 0;
  double taper_x = 0;
  double taper_y = 0;
  double texture = 0;
  double texture_mm = 0;
};

struct OpticsModel {
  double pressed_slope = 0;
  double pressed_curve = 0;
  double bulged_slope = 0;
  double bulged_curve = 0;
  double narrow_mm = 0;
  double wide_mm = 0;
  double narrow_weight = 0;
  double far_mm = 0;
  double far_weight = 0;
  double growth = 0;
  /// Not empty: instead of the four numbers above.
  std::vector<double> knots;
  std::vector<double> slopes;  ///< same size
};

enum class Arrangement : std::uint8_t { ring, sides };

struct LightModel {
  Arrangement arrangement = Arrangement::ring;
  double level = 0;
  double led_radius_mm = 0;
  double led_distance_mm = 0;
  double fill = 0;
  double vignetting = 0;
};

/// Where a pressed object is at one moment. Linear in time between two of them; the object is away
/// before the first and stays as it is after the last.
struct PressKey {
  double time_s = 0;
  double x_mm = 0;  ///< From the image's centre, to the right (Place).
  double y_mm = 0;  ///< From the image's centre, downwards.
  double depth_mm = 0;
  double rotation_deg = 0;  ///< Clockwise as the camera sees it.
  /// After the rotation: a rotation vector in the sensor's axes, x right and y down.
  double tilt_x_deg = 0;
  double tilt_y_deg = 0;
  /// How far the object, sticking to the gel, has dragged it along.
  double drag_x_mm = 0;
  double drag_y_mm = 0;
};

struct Press {
  Object object;
  std::vector<PressKey> keys;  ///< At least one, times strictly ascending.
};

enum class FaultKind : std::uint8_t {
  drop,
  repeat,
  torn,
  truncate,
  stall,
  unplug,
  hang,
  auto_exposure,
  covered
};

struct Fault {
  FaultKind kind = FaultKind::drop;
  std::uint64_t frame = 0;   ///< Sequence of the first frame it strikes.
  std::uint64_t frames = 1;  ///< How many.
};

struct Scene {
  std::string sensor;  ///< Names the simulated sensor: its camera's identity.
  CameraModel camera;
  GelModel gel;
  SurfaceModel surface;
  OpticsModel optics;
  LightModel light;
  double loop_from_s = 0;  ///< After loop_to_s the time goes on here.
  double loop_to_s = 0;    ///< 0: no loop.
  std::vector<Press> presses;
  std::vector<Fault> faults;

  /// Seconds of the choreography at frame `sequence`.
  [[nodiscard]] double time_s(std::uint64_t sequence) const noexcept;
  /// A fault of this kind strikes frame `sequence`.
  [[nodiscard]] bool strikes(FaultKind kind, std::uint64_t sequence) const noexcept;
};

/// The built-in scene, config/scenes/default.toml as it was when the library was built.
[[nodiscard]] Scene default_scene();

/// A scene file. What its tables leave out of camera, gel, optics and light is as in the built-in
/// scene; presses, faults and the loop are its own. Throws std::runtime_error naming file, line,
/// key and what is allowed.
[[nodiscard]] Scene load_scene(const std::filesystem::path& file);

/// The same from text; `name` stands for the file in messages. Height-map images are looked for
/// beside `folder`.
[[nodiscard]] Scene parse_scene(std::string_view toml, const std::string& name,
                                const std::filesystem::path& folder = {});

/// The same sensor in another camera mode: the field of view stays, its width spread over `width`
/// pixels.
[[nodiscard]] Scene at_mode(Scene scene, int width, int height, double fps);

}  // namespace dtact::hal::sim
