#pragma once

#include <cstdint>
#include <optional>
#include <span>

#include "daemon/pipeline/health.hpp"
#include "daemon/pipeline/untouched/cells.hpp"
#include "daemon/pipeline/untouched/exposure_watch.hpp"
#include "daemon/pipeline/untouched/luma_grid.hpp"
#include "daemon/pipeline/untouched/touch_check.hpp"
#include "hal/frame.hpp"

namespace dtact::pipeline {

/// What the picture itself tells about how far depth can be believed, from the statistics that the
/// look for activity gathers. What each limit is worth in millimetres, and what no limit can tell,
/// is in tests/accuracy/atlas. One thread; does not allocate after construction.
class ImageWatch {
 public:
  /// Depth is measured against this from now on: Q8 luma, frame sized. `region`: as for TouchCheck.
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
  [[nodiscard]] const HealthSet& conditions() const noexcept { return conditions_; }

 private:
  std::optional<LightCompared> compare_light(const CellReport& report, const hal::LumaView& luma,
                                             double light) noexcept;

  TouchCheck check_;
  CellRegion region_;
  LumaGrid reference_;
  LumaGrid now_;
  LightField field_{};
  bool have_reference_ = false;
  bool drifted_ = false;
  int until_check_ = 0;
  int active_then_ = 0;  // cells when the light was compared last
  int banded_ = 0;       // frames with ripple, less those without
  HealthSet conditions_;
};

}  // namespace dtact::pipeline
