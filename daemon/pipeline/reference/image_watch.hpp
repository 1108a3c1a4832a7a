#pragma once

#include <cstdint>
#include <optional>
#include <span>

#include "daemon/pipeline/health.hpp"
#include "daemon/pipeline/reference/cells.hpp"
#include "daemon/pipeline/reference/contact_check.hpp"
#include "daemon/pipeline/reference/luma_grid.hpp"
#include "hal/frame.hpp"

namespace dtact::pipeline {

/// A frame beside its reference, once one smooth light is taken out of what differs.
struct LightCompared {
  double brighter = 0;  ///< How much brighter the light is than the followed one, as a share.
  double lost = 0;      ///< What covers takes this share of the whole picture's light.
};

/// Detects automatic exposure or gain, whatever the camera reports of its controls, by its unique
/// effect: something covers part of the picture, and at once the rest brightens
/// by about as much as keeps the mean. A press differs: the gel does not compress, so
/// the bulge around it returns the light that it takes. Light that changes by
/// itself or by command differs too: not when a cover begins. One thread; does not allocate.
class ExposureWatch {
 public:
  /// There is a new reference: whatever exposure it was taken with, it begins with that.
  void restart() noexcept { *this = {}; }
  /// No depth is measured at present.
  void forget() noexcept;
  /// The next frame against a reference that was taken without contact. `compared`: where it
  /// was.
  void look(const LightSeen& light, const std::optional<LightCompared>& compared,
            std::int64_t timestamp_ns) noexcept;

  /// It was seen since restart().
  [[nodiscard]] bool follows() const noexcept { return follows_; }

  /// The least share of the light that is lost, and that the rest brightens by. No press of the
  /// atlas takes more than 0.1 % of the whole, nor does any light that it has look as more than
  /// 0.9 %.
  static constexpr double kLost = 0.02;
  static constexpr double kBrighter = 0.01;
  /// Between these, as a multiple of what would keep the mean: cameras weigh the middle of the
  /// picture more than its edges, or the reverse, and see more of it than is calibrated.
  static constexpr double kMinShare = 0.4;
  static constexpr double kMaxShare = 4;
  /// It begins so soon after nothing was there, and lasts so long.
  static constexpr std::int64_t kSoonNs = 5'000'000'000;
  static constexpr std::int64_t kLastsNs = 1'000'000'000;

 private:
  double excess_ = 0;  // brighter than the followed light by this share without contact
  std::optional<std::int64_t> last_no_contact_ns_;  // without contact last
  std::optional<std::int64_t> since_ns_;            // it is being seen
  bool follows_ = false;
};

/// Rates how far depth can be trusted from the picture alone, using the statistics gathered by
/// the search for activity. tests/accuracy/atlas has each limit in millimetres, and what no limit
/// can detect. One thread; does not allocate after construction.
class ImageWatch {
 public:
  /// Depth is measured against this from now on: Q8 luma, frame sized. `region`: as for
  /// ContactCheck.
  void set_reference(std::span<const std::uint16_t> reference_q8, int width, int height,
                     const CellRegion& region) noexcept;
  /// The next frame. Cheap, but while a quarter of the picture is active for every sixteenth one
  /// and where another quarter becomes active: then the light is compared, in up to half a
  /// millisecond. `light`: the factor on the reference that is followed. Returns what the
  /// comparison found, where there was one.
  std::optional<LightCompared> look(const CellReport& report, const hal::LumaView& luma,
                                    double light) noexcept;
  /// No depth is measured at present, so nothing is said about it.
  void forget() noexcept;

  /// Grey levels, of the whole frame.
  [[nodiscard]] double reference_mean() const noexcept { return reference_.mean; }
  [[nodiscard]] const HealthSet& health_flags() const noexcept { return health_flags_; }

 private:
  std::optional<LightCompared> compare_light(const CellReport& report, const hal::LumaView& luma,
                                             double light) noexcept;

  ContactCheck check_;
  CellRegion region_;
  LumaGrid reference_;
  LumaGrid now_;
  LightField field_{};
  bool have_reference_ = false;
  bool drifted_ = false;
  int until_check_ = 0;
  int active_then_ = 0;  // cells when the light was compared last
  int banded_ = 0;       // frames with ripple, less those without
  HealthSet health_flags_;
};

}  // namespace dtact::pipeline
