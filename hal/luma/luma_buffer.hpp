#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>

#include "hal/frame.hpp"

namespace dtact::hal::luma {

/// Memory of one grey image, made once and used again. Rows begin at multiples of 64 bytes, and
/// kLumaPadding bytes after the last pixel may be read. Starts black. Move-only; a moved-from
/// buffer has no pixels.
class LumaBuffer {
 public:
  static constexpr std::size_t kAlignment = 64;

  LumaBuffer() = default;
  /// Throws std::invalid_argument unless both sides are 1…16384 pixels.
  LumaBuffer(int width, int height);
  LumaBuffer(LumaBuffer&& other) noexcept;
  LumaBuffer& operator=(LumaBuffer&& other) noexcept;
  LumaBuffer(const LumaBuffer&) = delete;
  LumaBuffer& operator=(const LumaBuffer&) = delete;
  ~LumaBuffer() = default;

  [[nodiscard]] int width() const noexcept { return width_; }
  [[nodiscard]] int height() const noexcept { return height_; }
  [[nodiscard]] std::ptrdiff_t stride() const noexcept { return stride_; }
  [[nodiscard]] std::uint8_t* data() noexcept { return bytes_.get(); }
  [[nodiscard]] std::uint8_t* row(int y) noexcept { return bytes_.get() + y * stride_; }
  [[nodiscard]] LumaView view() const noexcept { return {bytes_.get(), width_, height_, stride_}; }

 private:
  struct Free {
    void operator()(std::uint8_t* bytes) const noexcept;
  };
  std::unique_ptr<std::uint8_t[], Free> bytes_;
  int width_ = 0;
  int height_ = 0;
  std::ptrdiff_t stride_ = 0;
};

}  // namespace dtact::hal::luma
