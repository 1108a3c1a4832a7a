// The vector kernels that interpolate a coarse map, against the scalar ones.
#include "daemon/recon/vector_upsample.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <random>
#include <vector>

#include "daemon/recon/model.hpp"
#include "tests/unit/recon/every_target.hpp"

namespace dtact::recon::vec {
namespace {

class VectorUpsample : public EveryTarget {
 protected:
  static constexpr std::int16_t kUnwritten = 12321;

  int uniform(int low, int high) { return std::uniform_int_distribution(low, high)(random_); }
  /// Depths of the whole range, including its ends and untrusted ones.
  std::vector<std::int16_t> depths(int count) {
    std::vector<std::int16_t> out(static_cast<std::size_t>(count));
    for (std::int16_t& um : out) {
      const int dice = uniform(0, 7);
      um = static_cast<std::int16_t>(dice == 0   ? kUntrusted
                                     : dice == 1 ? 16383
                                     : dice == 2 ? -16383
                                                 : uniform(-16383, 16383));
    }
    return out;
  }
  std::int16_t share() { return static_cast<std::int16_t>(uniform(0, 4) * 4096); }

 private:
  std::minstd_rand random_{23};
};

TEST_P(VectorUpsample, WidenRow) {
  for (int count = kWidenedAtOnce; count <= 80; count += kWidenedAtOnce) {
    for (const int phases : {2, 4}) {
      const std::vector<std::int16_t> coarse = depths(count + 2);
      const kernels::Phases where{phases, {share(), share(), share(), share()}};
      std::vector<std::int16_t> should(static_cast<std::size_t>(count * phases) + 1, kUnwritten);
      std::vector<std::int16_t> fine = should;
      kernels::widen_row(coarse.data() + 1, where, count, should.data());
      vec::widen_row(coarse.data() + 1, where, count, fine.data());
      ASSERT_EQ(fine, should) << count << " by " << phases;
    }
  }
}

TEST_P(VectorUpsample, BetweenRowOfEveryWidth) {
  for (int width = 1; width <= 100; ++width) {
    const int padded = (width + kBetweenAtOnce - 1) / kBetweenAtOnce * kBetweenAtOnce;
    const std::vector<std::int16_t> near = depths(padded);
    const std::vector<std::int16_t> other = depths(padded);
    const std::int16_t part = share();
    std::vector<std::int16_t> should(static_cast<std::size_t>(padded) + 1, kUnwritten);
    std::vector<std::int16_t> fine = should;
    kernels::between_row(near.data(), other.data(), part, width, should.data());
    vec::between_row(near.data(), other.data(), part, width, fine.data());
    ASSERT_EQ(fine, should) << width;
  }
}

DTACT_EVERY_TARGET(VectorUpsample);

}  // namespace
}  // namespace dtact::recon::vec
