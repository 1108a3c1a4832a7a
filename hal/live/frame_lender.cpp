#include "hal/live/frame_lender.hpp"

#include <algorithm>
#include <span>
#include <utility>

#include "hal/base/clock.hpp"

namespace dtact::hal::live {
namespace {

/// Frame indices from here on are loans of the source's buffers; below, buffers of the pool.
constexpr int kLentPayload = 2;

}  // namespace

FrameLender::FrameLender(int width, int height)
    : pool_{luma::LumaBuffer(width, height), luma::LumaBuffer(width, height)} {}

PayloadStatus FrameLender::deliver(PayloadDecoder& decoder, const Filled& filled, FrameInfo frame,
                                   Frame& out, bool& kept) noexcept {
  const Format format = current_->format();
  const auto loan = std::ranges::find(loans_, nullptr, &Loan::lender);
  kept = format.lendable && format.full_range && format.encoding == Encoding::grey &&
         loan != loans_.end();
  if (kept) {
    *loan = {current_, filled.index};
    const std::ptrdiff_t stride = format.bytes_per_line > 0 ? format.bytes_per_line : format.width;
    out = Frame(*this, kLentPayload + static_cast<int>(loan - loans_.begin()),
                {filled.payload.data(), format.width, format.height, stride}, frame);
    return PayloadStatus::ok;
  }

  const int index = lent_[0].load(std::memory_order_acquire) ? 1 : 0;
  luma::LumaBuffer& buffer = pool_[static_cast<std::size_t>(index)];
  const std::int64_t begin = base::system_clock().monotonic_ns();
  const PayloadStatus status = decoder.decode(filled, buffer);
  if (status != PayloadStatus::ok) return status;
  frame.decode_ns = base::system_clock().monotonic_ns() - begin;
  lent_[static_cast<std::size_t>(index)].store(true, std::memory_order_relaxed);
  kept = format.encoding == Encoding::jpeg;
  if (kept) jpegs_[static_cast<std::size_t>(index)] = {current_, filled.index};
  out = Frame(*this, index, buffer.view(), frame,
              kept ? filled.payload : std::span<const std::uint8_t>{});
  return status;
}

void FrameLender::give_back(int index) noexcept {
  if (index >= kLentPayload) {
    return end_loan(loans_[static_cast<std::size_t>(index - kLentPayload)]);
  }
  end_loan(jpegs_[static_cast<std::size_t>(index)]);
  lent_[static_cast<std::size_t>(index)].store(false, std::memory_order_release);
}

void FrameLender::end_loan(Loan& taken) noexcept {
  const Loan loan = std::exchange(taken, Loan{});
  // Of a source that has been let go, nobody waits for the buffer. An error is met by the next
  // call of dequeue().
  if (loan.lender && loan.lender == current_) (void)loan.lender->enqueue(loan.index);
}

}  // namespace dtact::hal::live
