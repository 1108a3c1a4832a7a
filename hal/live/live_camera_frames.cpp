// From the driver's queue to a frame: the newest whole buffer, lent or decoded, and what is
// counted.
#include <algorithm>
#include <utility>

#include "hal/base/clock.hpp"
#include "hal/live/live_camera.hpp"

namespace dtact::hal::live {
namespace {

/// Frame indices from here on are loans of the source's buffers; below, buffers of the pool.
constexpr int kLentPayload = 2;
/// Buffers looked at in one call: they go back as others come out, so there could be no end.
constexpr unsigned kMaxTaken = 8;
/// In frames; a larger step of the driver's count is a new count.
constexpr std::uint32_t kPlausibleGap = 1U << 16U;
}  // namespace

LiveCamera::Collected LiveCamera::collect(Frame& out) noexcept {
  Source& source = *connection_->source;
  // The newest whole frame, and the one before in case that the newest cannot be decoded.
  std::array<std::pair<Filled, std::uint64_t>, 2> whole;  // with its sequence; oldest first
  std::size_t count = 0;
  bool damaged = false;
  for (unsigned taken = 0; taken < kMaxTaken; ++taken) {
    Filled filled;
    const DequeueStatus status = source.dequeue(filled);
    if (status == DequeueStatus::none) break;
    if (status == DequeueStatus::failed) return Collected::lost;
    last_buffer_ns_ = base::system_clock().monotonic_ns();
    count_gap(filled.sequence);
    const PayloadStatus payload = connection_->decoder.inspect(filled);
    int home = filled.index;
    if (payload != PayloadStatus::ok) {
      count_damage(payload);
      damaged = true;
    } else if (count < whole.size()) {
      whole[count++] = {filled, sequence_};
      continue;
    } else {
      home = whole[0].first.index;
      whole[0] = std::exchange(whole[1], {filled, sequence_});
      add(counters_.skipped);
    }
    if (!source.enqueue(home)) return Collected::lost;
  }
  bool done = false;
  for (std::size_t i = count; i-- > 0;) {
    const auto& [filled, sequence] = whole[i];
    if (done) {
      add(counters_.skipped);
    } else {
      bool kept = false;
      const PayloadStatus status = deliver(filled, sequence, out, kept);
      done = status == PayloadStatus::ok;
      if (!done) count_damage(status);
      damaged = damaged || !done;
      if (kept) continue;
    }
    // A frame that was delivered stays delivered: the next call meets the error again.
    if (!source.enqueue(filled.index) && !done) return Collected::lost;
  }
  if (done) return Collected::frame;
  return damaged ? Collected::damaged : Collected::nothing;
}

PayloadStatus LiveCamera::deliver(const Filled& filled, std::uint64_t sequence, Frame& out,
                                  bool& kept) noexcept {
  FrameInfo frame;
  frame.sequence = sequence;
  frame.timestamp_ns = filled.timestamp_ns;
  frame.meaning = filled.meaning;
  frame.ready_ns = last_buffer_ns_;
  const Format format = connection_->source->format();
  const auto loan = std::ranges::find(loans_, nullptr, &Loan::lender);
  kept = format.lendable && format.full_range && format.encoding == Encoding::grey &&
         loan != loans_.end();
  if (kept) {
    *loan = {connection_->source, filled.index};
    frame.flags = take_flags();
    const std::ptrdiff_t stride = format.bytes_per_line > 0 ? format.bytes_per_line : format.width;
    out = Frame(*this, kLentPayload + static_cast<int>(loan - loans_.begin()),
                {filled.payload.data(), format.width, format.height, stride}, frame);
    note_delivery();
    return PayloadStatus::ok;
  }

  const int index = lent_[0].load(std::memory_order_acquire) ? 1 : 0;
  luma::LumaBuffer& buffer = pool_[static_cast<std::size_t>(index)];
  const std::int64_t begin = base::system_clock().monotonic_ns();
  const PayloadStatus status = connection_->decoder.decode(filled, buffer);
  if (status != PayloadStatus::ok) return status;
  frame.decode_ns = base::system_clock().monotonic_ns() - begin;
  frame.flags = take_flags();
  lent_[static_cast<std::size_t>(index)].store(true, std::memory_order_relaxed);
  kept = format.encoding == Encoding::jpeg;
  if (kept) jpegs_[static_cast<std::size_t>(index)] = {connection_->source, filled.index};
  out = Frame(*this, index, buffer.view(), frame,
              kept ? filled.payload : std::span<const std::uint8_t>{});
  note_delivery();
  return status;
}

std::uint32_t LiveCamera::take_flags() noexcept {
  std::uint32_t flags = std::exchange(after_gap_, false) ? kFrameAfterGap : kFrameNormal;
  if (std::exchange(reopened_, false)) flags |= kFrameReopened;
  if (controls_moved_.load(std::memory_order_relaxed)) flags |= kFrameControlsMoved;
  return flags;
}

void LiveCamera::note_delivery() noexcept {
  add(counters_.delivered);
  if (state_.load(std::memory_order_relaxed) == CameraState::streaming) return;
  const std::lock_guard guard(mutex_);
  state_.store(CameraState::streaming);
  remedy_.clear();
}

void LiveCamera::give_back(int index) noexcept {
  if (index >= kLentPayload) {
    return end_loan(loans_[static_cast<std::size_t>(index - kLentPayload)]);
  }
  end_loan(jpegs_[static_cast<std::size_t>(index)]);
  lent_[static_cast<std::size_t>(index)].store(false, std::memory_order_release);
}

void LiveCamera::end_loan(Loan& taken) noexcept {
  const Loan loan = std::exchange(taken, Loan{});
  // Of a source that has been let go, nobody waits for the buffer. An error is met by the next
  // call of dequeue().
  if (loan.lender && connection_ && loan.lender == connection_->source) {
    (void)loan.lender->enqueue(loan.index);
  }
}

void LiveCamera::count_gap(std::uint32_t counted) noexcept {
  // The driver's count begins anew with every connection, and within one with some drivers; ours
  // goes on.
  std::uint32_t step = last_counted_ ? counted - *last_counted_ : 1;
  if (step == 0 || step > kPlausibleGap) step = 1;
  last_counted_ = counted;
  sequence_ += step;
  if (step > 1) {
    add(counters_.lost, step - 1);
    after_gap_ = true;
  }
}

void LiveCamera::count_damage(PayloadStatus status) noexcept {
  switch (status) {
    case PayloadStatus::flagged:
      return add(counters_.flagged);
    case PayloadStatus::markers:
      return add(counters_.markers);
    case PayloadStatus::too_short:
      return add(counters_.too_short);
    case PayloadStatus::undecodable:
      return add(counters_.undecodable);
    case PayloadStatus::ok:
      return;
  }
}

}  // namespace dtact::hal::live
