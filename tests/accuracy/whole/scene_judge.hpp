#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "daemon/pipeline/health.hpp"
#include "tests/accuracy/whole/random_draw.hpp"

namespace dtact::whole {

/// One judged frame of a client compared with the truth. Lengths in mm; NaN: nothing to compare.
struct FrameErrors {
  JudgedFrame frame;
  double stated = NAN;     ///< DepthMap.uncertainty_um.
  double inside = NAN;     ///< Mean absolute error in contact, …
  double beside = NAN;     ///< … within kBesideMm around it, …
  double away = NAN;       ///< … and everywhere else.
  double untrusted = NAN;  ///< Share of the pixels in contact.
  bool in_contact = false;
  bool pressed = false;   ///< An object is in contact, truly and within the map.
  double true_area = 0;   ///< True area deeper than the contact threshold, mm².
  double area = NAN;      ///< Reported area as a share of the true one, minus 1.
  double centroid = NAN;  ///< Distance from the true centroid.
  double deepest = NAN;   ///< Reported minus true.
  double true_deepest = 0;
  double points = NAN;     ///< Mean distance of the contact's points from the true surface, …
  double points_95 = NAN;  ///< … and 95 % within.
  double force = NAN;      ///< Reported minus true, newtons.
  double true_force = 0;
  double stated_force = NAN;
  std::uint32_t health = 0;  ///< Bits of pipeline::Health.

  /// A flag reports that the picture is unfit for depth, which no uncertainty covers.
  /// Pixels deeper than calibrated are untrusted and do not affect the others.
  [[nodiscard]] bool is_flagged() const noexcept;
  /// The stated uncertainty is "inside the contact": NaN where none is reported.
  [[nodiscard]] double inside_ratio() const noexcept { return in_contact ? inside / stated : NAN; }
};

struct SceneReport {
  std::string name;
  std::string what;
  LightCase light = LightCase::same;
  double thickness_mm = 0;
  double calibrated_mm = 0;  ///< Greatest depth of the lookup table.
  std::vector<FrameErrors> frames;
  /// Frames from the first judged one on, and of those: with the flag, and with it without cause.
  int watched = 0;
  std::array<int, pipeline::kHealthCount> flagged{};
  std::array<int, pipeline::kHealthCount> false_alarms{};
  int beyond_missed = 0;  ///< Judged frames truly deeper than calibrated without the flag.

  /// The unflagged frame with the largest error against its uncertainty: every kMapStep-th pixel,
  /// micrometres.
  int map_width = 0;
  std::vector<std::int16_t> true_map;
  std::vector<std::int16_t> map;
  double worst_ratio = 0;
};

inline constexpr double kBesideMm = 1;
inline constexpr int kMapStep = 4;

/// Plays a scene through the whole program on the sensor's calibration.
[[nodiscard]] SceneReport judge(RandomScene scene, const std::filesystem::path& calibration);

}  // namespace dtact::whole
