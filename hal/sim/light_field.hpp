#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "hal/light_ring.hpp"
#include "hal/sim/grid.hpp"
#include "hal/sim/scene.hpp"

namespace dtact::hal::sim {

/// Irregularities of a real gel without contact: bubbles, dust under the paint, old dents.
/// Random numbers on a lattice, joined by cubic B-splines; always the same ones, since they belong
/// to the sensor. Immutable.
class Texture {
 public:
  /// `rms`: share of the light; `size_mm`: the lattice's pitch, about the width of a mark.
  Texture(double rms, double size_mm) noexcept;

  /// Share of the light by which this place is brighter (or, negative, darker).
  [[nodiscard]] double at(const Place& place) const noexcept;

 private:
  double scale_;
  double size_mm_;
};

/// How bright each LED is: luma of its colour times brightness, 0 … 65025.
using LedLevels = std::array<std::uint16_t, kLedCount>;

[[nodiscard]] LedLevels led_levels(const Light& light) noexcept;
/// Half of each: what a frame sees whose exposure lies half before and half after a change.
[[nodiscard]] LedLevels mean(const LedLevels& a, const LedLevels& b) noexcept;

/// The light on the undeformed gel as the camera sees it. Every LED shines through the diffuser
/// as a point source on a plane: (1 + ρ²/d²)^−2 at the distance ρ from its foot (inverse square,
/// and Lambert's cosine at both ends), plus an even share. The lens vignettes with the square of
/// the radius, and the gel has its faint texture.
class LightField {
 public:
  explicit LightField(const Scene& scene);

  /// Grey levels before gamma, Q6, up to 1023 levels (the camera clips later). `out`: one value a
  /// pixel, row-major.
  void compute(const LedLevels& levels, std::span<std::uint16_t> out) const noexcept;

 private:
  std::size_t pixels_;
  std::vector<std::uint16_t> shares_;  // LED after LED: grey at full brightness, Q10
};

}  // namespace dtact::hal::sim
