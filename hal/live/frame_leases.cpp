#include "hal/live/frame_leases.hpp"

#include <algorithm>
#include <span>
#include <utility>

#include "hal/base/clock.hpp"

namespace dtact::hal::live {
namespace {

/// Frame indices from here on are loans of the source's buffers; below, buffers of the pool.
constexpr int kLeasedPayload = 2;

}  // namespace

FrameLeases::FrameLeases(int width, int height)
    : pool_{luma::LumaBuffer(width, height), luma::LumaBuffer(width, height)} {}

PayloadStatus FrameLeases::deliver(PayloadDecoder& decoder, const FilledBuffer& filled,
                                   FrameInfo frame, Frame& out, bool& kept) noexcept {
  const Format format = current_->format();
  const auto lease = std::ranges::find(leased_buffers_, nullptr, &Lease::source);
  kept = format.zero_copy && format.full_range && format.encoding == Encoding::grey &&
         lease != leased_buffers_.end();
  if (kept) {
    *lease = {current_, filled.index};
    const std::ptrdiff_t stride = format.bytes_per_line > 0 ? format.bytes_per_line : format.width;
    out = Frame(*this, kLeasedPayload + static_cast<int>(lease - leased_buffers_.begin()),
                {filled.payload.data(), format.width, format.height, stride}, frame);
    return PayloadStatus::ok;
  }

  const int index = leased_[0] ? 1 : 0;
  luma::LumaBuffer& buffer = pool_[static_cast<std::size_t>(index)];
  const std::int64_t begin = base::system_clock().monotonic_ns();
  const PayloadStatus status = decoder.decode(filled, buffer);
  if (status != PayloadStatus::ok) return status;
  frame.decode_ns = base::system_clock().monotonic_ns() - begin;
  leased_[static_cast<std::size_t>(index)] = true;
  kept = format.encoding == Encoding::jpeg;
  if (kept) jpegs_[static_cast<std::size_t>(index)] = {current_, filled.index};
  out = Frame(*this, index, buffer.view(), frame,
              kept ? filled.payload : std::span<const std::uint8_t>{});
  return status;
}

void FrameLeases::give_back(int index) noexcept {
  if (index >= kLeasedPayload) {
    return end_lease(leased_buffers_[static_cast<std::size_t>(index - kLeasedPayload)]);
  }
  end_lease(jpegs_[static_cast<std::size_t>(index)]);
  leased_[static_cast<std::size_t>(index)] = false;
}

void FrameLeases::end_lease(Lease& taken) noexcept {
  const Lease lease = std::exchange(taken, Lease{});
  // A source that has been closed does not need the buffer any more. The next call of dequeue()
  // reports an error.
  if (lease.source && lease.source == current_) (void)lease.source->enqueue(lease.index);
}

}  // namespace dtact::hal::live
