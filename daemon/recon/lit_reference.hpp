#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "daemon/recon/model.hpp"
#include "daemon/recon/smoother.hpp"

namespace dtact::recon {

/// The published method's smoothing, half of it from the middle on, Q14.
[[nodiscard]] std::vector<std::int16_t> published_taps();
/// The taps that a model's method smooths with.
[[nodiscard]] std::vector<std::int16_t> taps_of(const Model& model);

/// The reference image on the map's pixels, as it was taken and in the present light, with the
/// factor that scales a difference from it to one from the calibration's reference. Rows are
/// whole blocks. Allocates at construction only.
class LitReference {
 public:
  /// Takes the calibration's own reference.
  explicit LitReference(std::shared_ptr<const Model> model);

  /// Another one, as the camera sees it, Q8.
  void set(std::span<const std::uint16_t> reference_q8) noexcept;
  /// The light is now `factor` times what it was when the reference was taken. The published method
  /// knows no such thing.
  void set_light(double factor) noexcept;

  /// Row `y` in the present light, Q6.
  [[nodiscard]] const std::int16_t* q6(int y) const noexcept { return lit_q6_.data() + at(y); }
  /// Its gains, Q12, 0 where untrusted.
  [[nodiscard]] const std::int16_t* gain_q12(int y) const noexcept {
    return lit_gain_q12_.data() + at(y);
  }
  /// For levels that are under their gain already: one, 0 where untrusted.
  [[nodiscard]] const std::int16_t* marks_q12(int y) const noexcept {
    return marks_q12_.data() + at(y);
  }
  /// Not 0 where untrusted.
  [[nodiscard]] const std::uint8_t* untrusted(int y) const noexcept {
    return untrusted_.data() + at(y);
  }
  /// Counts the references: each has its own reference map.
  [[nodiscard]] std::uint64_t count() const noexcept { return count_; }

 private:
  /// Where row y begins in the planes below.
  [[nodiscard]] std::size_t at(int y) const noexcept {
    return static_cast<std::size_t>(y) * stride_;
  }
  void rectify(std::span<const std::uint16_t> reference_q8) noexcept;
  void smooth(std::span<std::int16_t> smoothed) noexcept;

  std::shared_ptr<const Model> model_;
  int width_;
  int height_;
  std::size_t stride_;
  Smoother smoother_;
  RowBuffer in_;
  RowBuffer out_;
  RowBuffer fine_;                            ///< The rows of one row of a coarse map.
  std::vector<std::int16_t> calibration_q6_;  ///< Smoothed reference of the calibration.
  std::vector<std::int16_t> taken_q6_;
  std::vector<std::int16_t> taken_gain_q12_;
  std::vector<std::int16_t> lit_q6_;
  std::vector<std::int16_t> lit_gain_q12_;
  std::vector<std::int16_t> marks_q12_;
  std::vector<std::uint8_t> untrusted_;
  std::uint64_t count_ = 0;
};

}  // namespace dtact::recon
