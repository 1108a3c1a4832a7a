#include "hal/sim/noise.hpp"

#include <algorithm>
#include <cmath>

namespace dtact::hal::sim {
namespace {

// The sum of four random bytes: mean 510, standard deviation √(4·(256² − 1)/12), close to a normal
// distribution out to three standard deviations.
constexpr int kMean = 510;
constexpr double kDeviation = 147.8;

// Steele, Lea, Flood: Fast splittable pseudorandom number generators (2014).
std::uint64_t splitmix64(std::uint64_t x) {
  x += 0x9E3779B97F4A7C15U;
  x = (x ^ (x >> 30U)) * 0xBF58476D1CE4E5B9U;
  x = (x ^ (x >> 27U)) * 0x94D049BB133111EBU;
  return x ^ (x >> 31U);
}

// MurmurHash3's finaliser (Appleby): every input bit changes every output bit half of the time.
inline std::uint32_t mix(std::uint32_t x) {
  x = (x ^ (x >> 16U)) * 0x85EBCA6BU;
  x = (x ^ (x >> 13U)) * 0xC2B2AE35U;
  return x ^ (x >> 16U);
}

}  // namespace

Noise::Noise(std::uint64_t seed, double read, double shot) : seed_(splitmix64(seed)) {
  for (std::size_t grey = 0; grey < by_grey_.size(); ++grey) {
    const double sigma = std::sqrt(read * read + shot * shot * static_cast<double>(grey) / 160);
    // add() computes (4·deviate·amplitude) >> 16 in Q6. Beyond 4.6 grey levels it stays there.
    const double amplitude = sigma * 64 / kDeviation * 16384;
    by_grey_[grey] = static_cast<std::int16_t>(std::min(std::lround(amplitude), 32767L));
  }
}

void Noise::amplitude(std::span<const std::uint16_t> grey_q6,
                      std::span<std::int16_t> out) const noexcept {
  for (std::size_t i = 0; i < grey_q6.size(); ++i) out[i] = by_grey_[grey_q6[i] >> 6U];
}

void Noise::add(std::uint64_t sequence, std::uint32_t row, std::span<const std::uint16_t> grey_q6,
                std::span<const std::int16_t> amplitude, std::uint8_t* luma) const noexcept {
  const std::uint64_t key = splitmix64(splitmix64(seed_ ^ sequence) ^ row);
  const auto low = static_cast<std::uint32_t>(key);
  const auto high = static_cast<std::uint32_t>(key >> 32U) | 1U;
  const std::size_t n = grey_q6.size();
  const std::uint16_t* const grey = grey_q6.data();
  const std::int16_t* const scale = amplitude.data();
  for (std::size_t i = 0; i < n; ++i) {
    const std::uint32_t bits = mix(low + static_cast<std::uint32_t>(i) * high);
    const std::uint32_t pairs = (bits & 0x00FF00FFU) + ((bits >> 8U) & 0x00FF00FFU);
    const auto sum = static_cast<std::int32_t>((pairs & 0xFFFFU) + (pairs >> 16U));
    const std::int32_t noise = ((sum - kMean) * 4 * scale[i]) >> 16;
    const std::int32_t value = (grey[i] + noise + 32) >> 6;
    luma[i] = static_cast<std::uint8_t>(std::clamp(value, 0, 255));
  }
}

}  // namespace dtact::hal::sim
