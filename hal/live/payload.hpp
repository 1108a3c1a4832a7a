#pragma once

#include <cstdint>
#include <memory>

#include "hal/live/source.hpp"
#include "hal/luma/luma.hpp"
#include "hal/mjpeg/grey_decoder.hpp"

namespace dtact::hal::live {

enum class PayloadStatus : std::uint8_t { ok, flagged, markers, too_short, undecodable };

/// Turns payloads of one format into luma. Does not allocate after construction.
class PayloadDecoder {
 public:
  /// `scale`: GreyDecoder's; raw formats have none.
  explicit PayloadDecoder(const Format& format, int scale = 1);

  /// Only this part of the next payloads needs decoding. It lies inside the image.
  void will_read(const Area& area) noexcept;
  /// Checks what needs no decoding: the driver's mark, the length, a JPEG's first and last
  /// marker.
  [[nodiscard]] PayloadStatus inspect(const FilledBuffer& filled) const noexcept;
  /// Unless ok, `out` is partly written and must not be used.
  [[nodiscard]] PayloadStatus decode(const FilledBuffer& filled, luma::LumaBuffer& out) noexcept;
  /// Why the newest payload was undecodable, in words that last; null when none was.
  [[nodiscard]] const char* damage() const noexcept { return damage_; }

 private:
  Format format_;
  std::unique_ptr<mjpeg::GreyDecoder> jpeg_;  // null for raw formats
  const char* damage_ = nullptr;
};

}  // namespace dtact::hal::live
