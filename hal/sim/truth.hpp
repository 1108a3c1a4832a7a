#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "hal/sim/grid.hpp"
#include "hal/sim/placement.hpp"
#include "hal/sim/scene.hpp"

namespace dtact::hal::sim {

/// The true values of every frame, a pure function of scene and sequence: the gel's indentation,
/// the objects' poses and the force. Contact is solved once at construction, at the presses' keys
/// and between them at intervals of solve_step_mm. Maps between are blended linearly in time,
/// while poses are exact: to compare a map with a pose, solve_step_mm has to be small.
/// Immutable afterwards: any thread may ask.
///
/// On a curved surface the geometry is exact: rays, normals, and how deep an object reaches along
/// them. The gel's response is that of a flat one on the unrolled surface, which is longer along a
/// sphere's parallels by the arc over its sine (4 % at half a radius from the apex); so are light
/// and scattering.
class Truth {
 public:
  /// Units of the maps in a millimetre.
  static constexpr int kPerMm = 8000;

  /// Takes about 50 ms for each map that the scene needs. Throws std::runtime_error when a contact
  /// has no solution.
  explicit Truth(const Scene& scene);

  /// Indentation of the gel's point that each pixel of the camera's image sees (distortion and
  /// perspective included), row-major, mm, positive = pressed, negative = bulge.
  void indentation_mm(std::uint64_t sequence, std::vector<float>& out) const;
  /// 255 in contact, 0 elsewhere; from the nearer one of the two maps between which
  /// the truth is blended.
  void contact(std::uint64_t sequence, std::vector<std::uint8_t>& out) const;

  /// The pose of a press's object (numbered in the scene, from 0), in contact or not; nothing
  /// before its first key.
  [[nodiscard]] std::optional<Pose> pose(std::size_t press, std::uint64_t sequence) const;
  /// The point of the undeformed surface that a pixel shows.
  [[nodiscard]] SurfacePoint surface_at(double column, double row) const;
  /// Newtons that all objects together press with along the surface's normal, ≥ 0: the pressure
  /// integrated, and so, the gel being linear, that of the blended map exactly.
  [[nodiscard]] double force_n(std::uint64_t sequence) const noexcept;

  /// The state of the gel at one frame: `from` + (`to` − `from`)·weight/2^15.
  struct Moment {
    int from = 0;
    int to = 0;
    int weight = 0;  ///< 0 … 32767
    bool operator==(const Moment&) const = default;
  };
  [[nodiscard]] Moment moment(std::uint64_t sequence) const noexcept;
  /// The blended map on the grid, in 1/kPerMm. `out` is grid sized.
  void blend(const Moment& moment, std::span<std::int16_t> out) const noexcept;

  [[nodiscard]] const Scene& scene() const noexcept { return scene_; }
  [[nodiscard]] const Grid& grid() const noexcept { return grid_; }
  [[nodiscard]] const PixelMap& pixels() const noexcept { return pixels_; }
  /// Number of solved maps, including that without contact.
  [[nodiscard]] std::size_t map_count() const noexcept { return maps_.size(); }

 private:
  struct Map {
    std::vector<std::int16_t> indentation;
    std::vector<std::int16_t> contact;  // 256 in contact
    double force_n = 0;
  };
  struct Instant {
    double time_s = 0;
    int map = 0;
  };
  void solve_all();
  template <typename Each, typename Out>
  void see(std::span<const std::int16_t> indentation, std::span<const std::int16_t> values,
           const Each& each, Out& out) const;

  Scene scene_;
  Grid grid_;
  PixelMap pixels_;
  std::vector<Map> maps_;          // [0] is without contact
  std::vector<Instant> instants_;  // times strictly ascending, the first is 0
};

}  // namespace dtact::hal::sim
