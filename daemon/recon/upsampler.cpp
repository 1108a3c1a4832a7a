#include "daemon/recon/upsampler.hpp"

#include <algorithm>
#include <cstdlib>

#include "daemon/recon/vector_upsample.hpp"

namespace dtact::recon {
namespace {

constexpr int round_up(int value, int step) { return (value + step - 1) / step * step; }

}  // namespace

Upsampler::Axis Upsampler::axis(int size, int from, int to) {
  Axis axis{.coarse = size / from, .fine = size / to, .phases = {.count = from / to}};
  // Where the maps begin, in the calibration's pixels.
  const int coarse_begin = (size - axis.coarse * from) / 2;
  const int fine_begin = (size - axis.fine * to) / 2;
  // The first fine pixel whose middle lies in a coarse one.
  while (2 * (fine_begin + axis.begin * to) + to < 2 * coarse_begin) ++axis.begin;
  for (int phase = 0; phase < axis.phases.count; ++phase) {
    // Twice the distance from the coarse pixel's middle; the next one's is 2 · from away.
    const int away = 2 * (fine_begin + (axis.begin + phase) * to - coarse_begin) + to - from;
    axis.phases.share_q15[static_cast<std::size_t>(phase)] =
        static_cast<std::int16_t>(std::abs(away) * (1 << 15) / (2 * from));
  }
  return axis;
}

Upsampler::Upsampler(int width, int height, int from, int to)
    : to_(to), columns_(axis(width, from, to)), rows_(axis(height, from, to)) {
  const int widened = round_up(columns_.coarse, vec::kWidenedAtOnce);
  const int needed = std::max(columns_.fine, columns_.begin + columns_.phases.count * widened);
  stride_ = static_cast<std::size_t>(round_up(needed, vec::kBetweenAtOnce));
  line_.resize(static_cast<std::size_t>(widened) + 2);
  wide_.resize(stride_ * static_cast<std::size_t>(rows_.coarse));
}

void Upsampler::widen(const std::int16_t* coarse, std::int16_t* wide) noexcept {
  const int widened = round_up(columns_.coarse, vec::kWidenedAtOnce);
  line_[0] = coarse[0];
  std::copy_n(coarse, columns_.coarse, line_.begin() + 1);
  std::fill(line_.begin() + 1 + columns_.coarse, line_.end(), coarse[columns_.coarse - 1]);
  vec::widen_row(line_.data() + 1, columns_.phases, widened, wide + columns_.begin);
  // What no coarse pixel covers is as the nearest one.
  std::fill_n(wide, columns_.begin, coarse[0]);
  const int end = columns_.begin + columns_.phases.count * columns_.coarse;
  std::fill(wide + end, wide + std::max(end, columns_.fine), coarse[columns_.coarse - 1]);
}

void Upsampler::run(std::span<const std::int16_t> coarse_um,
                    std::span<std::int16_t> fine_um) noexcept {
  const auto row_of = [this](int row) {
    return wide_.data() + static_cast<std::size_t>(std::clamp(row, 0, rows_.coarse - 1)) * stride_;
  };
  for (int row = 0; row < rows_.coarse; ++row) {
    widen(coarse_um.data() + std::ptrdiff_t{row} * columns_.coarse, row_of(row));
  }
  const int count = rows_.phases.count;
  for (int y = 0; y < rows_.fine; ++y) {
    // Floored, so that rows above the first coarse one count back from it.
    const int from_first = y - rows_.begin + count;
    const int row = from_first / count - 1;
    const int phase = from_first % count;
    const int other = 2 * phase < count ? row - 1 : row + 1;
    vec::between_row(row_of(row), row_of(other),
                     rows_.phases.share_q15[static_cast<std::size_t>(phase)], columns_.fine,
                     fine_um.data() + std::ptrdiff_t{y} * columns_.fine);
  }
}

}  // namespace dtact::recon
