#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "daemon/pipeline/health.hpp"
#include "daemon/pipeline/pipeline_config.hpp"
#include "daemon/pipeline/port.hpp"
#include "daemon/pipeline/reference/contact_check.hpp"
#include "daemon/pipeline/reference/luma_grid.hpp"
#include "daemon/pipeline/reference/reference_average.hpp"

namespace dtact::pipeline {

/// Says when the mean grey has stopped moving: over the last `settle_frames` frames it stayed
/// within `settle_grey` grey levels.
class SettleDetector {
 public:
  /// Throws std::invalid_argument when settle_frames is not 2 … 64.
  explicit SettleDetector(const ReferenceRules& rules);

  void reset() noexcept { count_ = 0; }
  /// Takes the next frame's mean; true once settled.
  [[nodiscard]] bool add(float mean_grey) noexcept;

 private:
  static constexpr std::size_t kMax = 64;
  std::size_t frames_;
  double grey_;
  std::array<float, kMax> means_{};
  std::size_t count_ = 0;
};

/// What the reference in use stands on.
enum class ReferenceQuality : std::uint8_t {
  none,      ///< There is none yet: no depth.
  fresh,     ///< Averaged under the present light without contact.
  restored,  ///< The last good one, made under the same light: after a start, and during contact.
  stale      ///< There is contact: an older one brought to the present light as well as it goes.
};

struct ReferenceStep {
  bool reference_changed = false;  ///< reference() has changed.
  std::optional<Outcome> answer;   ///< Result of the requested re-zero.
};

/// Decides when to take the reference image and which fallback to use until then. The sequence:
/// waits until the mean grey settles, averages, compares with an image known to be without contact,
/// and only then takes it. After a start the last run's reference serves meanwhile, if it is of the
/// same light. While a fallback reference is in use it checks every few frames whether there is no
/// contact, and takes a new one then. Allocates at construction only; one thread.
class ReferenceKeeper {
 public:
  ReferenceKeeper(int width, int height, const ReferenceRules& rules);

  /// The last good reference of an earlier run (Q8, frame sized). `same_light`: made under the
  /// present light; `same_shape`: under the same colours, at any brightness.
  void restore(std::span<const std::uint16_t> reference_q8, bool same_light, bool same_shape);
  /// What the calibration knows; the span and the grid must outlive their use here. `same_light`:
  /// as restore()'s. A fresh reference stays, whatever else is known is forgotten and the sequence
  /// begins again.
  void use_calibration(std::span<const std::uint16_t> reference_q8, const LumaGrid& grid,
                       const CellRegion& region, bool same_light) noexcept;
  /// The camera has (re)started: starts the sequence.
  void begin() noexcept;
  /// The light is about to change or has just changed: no depth until the next reference.
  /// `in_contact`: according to the last depth; `same_shape`: only the brightness changes.
  void light_changed(bool in_contact, bool same_shape) noexcept;
  /// Requests the present image as reference. A returned outcome is an immediate refusal; otherwise
  /// step() returns the outcome.
  [[nodiscard]] std::optional<Outcome> rezero(bool force, bool in_contact) noexcept;
  void cancel_rezero() noexcept {
    request_.reset();
    if (phase_ == Phase::holding) averaging_ = false;
  }

  /// Takes the next frame under settled light. Mostly cheap; a decision takes two frames' time.
  [[nodiscard]] ReferenceStep step(const hal::LumaView& luma) noexcept;

  /// The next image is needed for a reference, whole. Otherwise step() ignores it.
  [[nodiscard]] bool looks() const noexcept;
  [[nodiscard]] State state() const noexcept;
  [[nodiscard]] ReferenceQuality quality() const noexcept { return quality_; }
  /// False from a start or a light change until a reference or a fallback reference is there.
  [[nodiscard]] bool ready() const noexcept { return phase_ == Phase::holding; }
  /// The sequence runs because the camera (re)started, not because of the light.
  [[nodiscard]] bool starting() const noexcept { return !ready() && starting_; }
  /// No reference can be taken: the picture has been too dark for settle_frames frames.
  [[nodiscard]] bool dark() const noexcept { return dark_frames_ >= rules_.settle_frames; }
  /// Q8 luma, frame sized. Only when ready().
  [[nodiscard]] std::span<const std::uint16_t> reference() const noexcept;
  /// The reference in use may be stored for the next start: taken without contact.
  [[nodiscard]] bool storable() const noexcept {
    return quality_ == ReferenceQuality::fresh && !forced_;
  }

 private:
  enum class Phase : std::uint8_t { settling, averaging, holding };
  struct Known {
    std::span<const std::uint16_t> reference_q8;
    const LumaGrid* grid = nullptr;
  };

  struct Request {
    bool force = false;
  };

  void start_average() noexcept;
  ReferenceStep settle(const hal::LumaView& luma) noexcept;
  ReferenceStep gather(const hal::LumaView& luma) noexcept;
  void watch(const hal::LumaView& luma) noexcept;
  ReferenceStep decide(Outcome obstacle) noexcept;
  ReferenceStep take() noexcept;
  ReferenceStep use_fallback() noexcept;
  [[nodiscard]] bool is_doubtful() noexcept;
  [[nodiscard]] float contact_limit() const noexcept;
  [[nodiscard]] bool shows_contact(const LumaGrid& now) noexcept;
  [[nodiscard]] bool calibration_shows_contact(const LumaGrid& now) noexcept;
  [[nodiscard]] Known best_known() const noexcept;

  int width_;
  int height_;
  ReferenceRules rules_;
  SettleDetector settle_;
  ReferenceAverage average_;
  ContactCheck check_;
  CellRegion region_;
  Known calibration_;

  Phase phase_ = Phase::settling;
  ReferenceQuality quality_ = ReferenceQuality::none;
  bool starting_ = true;
  bool averaging_ = false;          // while holding: a new reference is being gathered
  bool no_contact_before_ = false;  // there was no contact right before the light changed
  bool other_light_ = false;        // the light differs from that of the known images
  bool same_shape_ = true;          // the light differs from it by a factor only
  bool forced_ = false;             // the last good reference may show an object
  std::optional<Request> request_;
  int waited_ = 0;       // frames since the sequence or the average began
  int dark_frames_ = 0;  // in a row, while no reference is in use
  int watched_ = 0;      // frames since the last look
  int clear_ = 0;        // consecutive checks without contact

  std::vector<std::uint16_t> good_;  // the last good reference
  LumaGrid good_grid_;
  bool have_good_ = false;
  bool stored_ = false;  // it is of an earlier run
  bool good_same_light_ = false;
  std::vector<std::uint16_t> candidate_;
  LumaGrid candidate_grid_;
  std::vector<std::uint16_t> fallback_;
  LumaGrid first_;  // of the average being gathered
  LumaGrid now_;
  LightField field_{};
};

}  // namespace dtact::pipeline
