#pragma once

#include <filesystem>
#include <functional>
#include <string>

namespace dtact::hal::sim {

/// Height of the places where an object has no surface at all, mm.
inline constexpr double kNoSurface = 1e3;

/// A rigid thing that is pressed into the gel, in its own frame: origin at its centre on the
/// level of its lowest point, x and y in the plane of the gel, z away from the camera.
struct Object {
  std::string kind;     ///< The name it has in a scene.
  double reach_mm = 0;  ///< Radius of a circle about the origin that holds all of it.
  /// Height of its surface at (x, y) above its lowest point, mm, ≥ 0; kNoSurface beside it.
  std::function<double(double x_mm, double y_mm)> height_mm;
  /// Its upper surface, wherever it has a lower one. None: its outline continues straight
  /// up without end, which only a tilt of nearly a right angle could show.
  std::function<double(double x_mm, double y_mm)> top_mm = nullptr;
};

/// Lengths in mm. Sources of the real dimensions stand with each definition.
[[nodiscard]] Object ball(double radius);
/// rows × columns balls, `pitch` apart.
[[nodiscard]] Object ball_array(double radius, double pitch, int rows, int columns);
[[nodiscard]] Object disc(double radius);
/// Two upright discs side by side along x, their centres `spacing` apart.
[[nodiscard]] Object two_pillars(double radius, double spacing);
/// A cube on one face.
[[nodiscard]] Object cube(double side);
/// A cylinder on its side, its axis along x.
[[nodiscard]] Object cylinder(double radius, double length);
/// Square ridges along y, half a pitch wide, on a square plate.
[[nodiscard]] Object grating(double pitch, double groove_depth, double side);
/// The calibration board of the real images.
[[nodiscard]] Object pin_board();
[[nodiscard]] Object m4_nut();
[[nodiscard]] Object m3_long_nut();
[[nodiscard]] Object m5_hexagon_screw();
[[nodiscard]] Object three_set_screws();
[[nodiscard]] Object star(double outer_radius);
[[nodiscard]] Object screw_cap();
[[nodiscard]] Object usb_c_plug();
[[nodiscard]] Object key();
/// Any relief: a PNG, white nearest to the gel, black `relief` higher up; the image's centre is
/// the origin and its columns run along x. Throws std::runtime_error naming the file.
[[nodiscard]] Object height_map(const std::filesystem::path& png, double mm_per_px, double relief);

}  // namespace dtact::hal::sim
