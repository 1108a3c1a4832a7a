#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>

namespace dtact::hal {

/// Bytes that may be read after the last pixel of the last row, so that vector loads need no tail
/// loop. Their values are unspecified.
inline constexpr std::size_t kLumaPadding = 64;

/// A grey image in full range (0 = black, 255 = white), rows from top to bottom as the camera sees
/// them. Rows are `stride` bytes apart, `stride >= width`.
struct LumaView {
  const std::uint8_t* data = nullptr;
  int width = 0;
  int height = 0;
  std::ptrdiff_t stride = 0;

  [[nodiscard]] const std::uint8_t* row(int y) const noexcept { return data + y * stride; }
};

/// A rectangle of an image, pixels.
struct Area {
  int x = 0;
  int y = 0;
  int width = 0;
  int height = 0;
  bool operator==(const Area&) const = default;
};

/// What the moment in FrameInfo::timestamp_ns is.
enum class TimestampMeaning : std::uint8_t {
  start_of_exposure,  ///< The first row's exposure began.
  first_packet,       ///< The frame's first bytes reached the driver: its first rows were exposed.
  end_of_frame,       ///< The last byte left the sensor or reached the driver.
  arrival             ///< The frame reached this process; nothing earlier is known.
};

/// What is odd about a frame that is still whole enough to use. A bit set.
enum FrameFlag : std::uint32_t {
  kFrameNormal = 0,
  /// The camera lost frames between this one and the one before (CameraReport::lost).
  kFrameAfterGap = 1U << 0U,
  /// A locked control of the camera has moved by itself: the brightness may have, too.
  kFrameControlsMoved = 1U << 1U,
  /// The device was opened and its controls were set anew since the frame before: the brightness
  /// may be another, however short it was away.
  kFrameReopened = 1U << 2U
};

struct FrameInfo {
  /// The camera's own counter. CameraReport says whether frames in a gap were lost or skipped.
  std::uint64_t sequence = 0;
  /// CLOCK_MONOTONIC, nanoseconds; `meaning` says which moment.
  std::int64_t timestamp_ns = 0;
  /// CLOCK_MONOTONIC, nanoseconds: when the frame's payload was complete at the HAL, before
  /// decoding.
  std::int64_t ready_ns = 0;
  /// Time spent turning the payload into luma, nanoseconds.
  std::int64_t decode_ns = 0;
  TimestampMeaning meaning = TimestampMeaning::arrival;
  std::uint32_t flags = kFrameNormal;
};

/// The owner of frame buffers. `index` is the owner's number of the buffer.
class FrameOwner {
 public:
  virtual void give_back(int index) noexcept = 0;

 protected:
  ~FrameOwner() = default;
};

/// A frame on loan: the buffer is released when the lease is destroyed or overwritten, which the
/// thread that grabs does. Must not outlive its camera. Move-only; a moved-from lease is empty.
class Frame {
 public:
  Frame() = default;
  Frame(FrameOwner& owner, int index, LumaView luma, FrameInfo info,
        std::span<const std::uint8_t> jpeg = {}) noexcept
      : owner_(&owner), index_(index), luma_(luma), jpeg_(jpeg), info_(info) {}
  Frame(Frame&& other) noexcept { swap(other); }
  Frame& operator=(Frame&& other) noexcept {
    Frame taken(std::move(other));
    swap(taken);
    return *this;
  }
  Frame(const Frame&) = delete;
  Frame& operator=(const Frame&) = delete;
  ~Frame() { reset(); }

  void reset() noexcept {
    if (owner_ != nullptr) std::exchange(owner_, nullptr)->give_back(index_);
    luma_ = {};
    jpeg_ = {};
  }
  [[nodiscard]] explicit operator bool() const noexcept { return owner_ != nullptr; }
  [[nodiscard]] const LumaView& luma() const noexcept { return luma_; }
  /// The whole JPEG that the luma was decoded from, as the camera sent it; it may end with padding.
  /// Empty when the camera sends something else. Valid until the next grab(), too.
  [[nodiscard]] std::span<const std::uint8_t> jpeg() const noexcept { return jpeg_; }
  [[nodiscard]] const FrameInfo& info() const noexcept { return info_; }

 private:
  void swap(Frame& other) noexcept {
    std::swap(owner_, other.owner_);
    std::swap(index_, other.index_);
    std::swap(luma_, other.luma_);
    std::swap(jpeg_, other.jpeg_);
    std::swap(info_, other.info_);
  }

  FrameOwner* owner_ = nullptr;
  int index_ = -1;
  LumaView luma_;
  std::span<const std::uint8_t> jpeg_;
  FrameInfo info_;
};

}  // namespace dtact::hal
