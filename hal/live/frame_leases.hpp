#pragma once

#include <array>
#include <cstdint>
#include <memory>

#include "hal/camera.hpp"
#include "hal/live/payload.hpp"
#include "hal/live/source.hpp"
#include "hal/luma/luma.hpp"

namespace dtact::hal::live {

/// Makes frames of the driver's buffers: lends the buffer where its bytes are the image already,
/// else decodes into one of two of its own. What was lent comes back by itself when the frame goes.
/// One thread's own.
class FrameLeases final : private FrameOwner {
 public:
  FrameLeases(int width, int height);

  /// Buffers of this source are requeued to its driver; null: buffers are not requeued.
  void use(const std::shared_ptr<Source>& source) noexcept { current_ = source; }
  /// Makes `out` of the payload; `frame` without its time to decode, which is added. `kept`: the
  /// payload itself was lent and comes back with the frame.
  [[nodiscard]] PayloadStatus deliver(PayloadDecoder& decoder, const FilledBuffer& filled,
                                      FrameInfo frame, Frame& out, bool& kept) noexcept;

 private:
  /// A payload that is lent. Two sources may have lent buffers of the same index at a time: one
  /// before and one after the camera was away.
  struct Lease {
    std::shared_ptr<Source> source;
    int index = -1;  // of the lender's buffer
  };

  void give_back(int index) noexcept override;
  void end_lease(Lease& lease) noexcept;

  std::shared_ptr<Source> current_;
  std::array<luma::LumaBuffer, 2> pool_;  // one with the caller, one to decode into
  std::array<bool, 2> leased_{};
  std::array<Lease, 2>
      leased_buffers_;          // one with the caller, one to deliver; without lender: free
  std::array<Lease, 2> jpegs_;  // what the pool's buffers were decoded from
};

}  // namespace dtact::hal::live
