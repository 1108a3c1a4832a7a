#include "daemon/recon/vector_kernels.hpp"

#include <gtest/gtest.h>
#include <sys/mman.h>

#include <algorithm>
#include <limits>
#include <random>
#include <span>
#include <string>
#include <tuple>
#include <vector>

#include "daemon/recon/model.hpp"
#include "tests/unit/recon/every_target.hpp"

namespace dtact::recon::vec {
namespace {

using Entry = RectifyTable::Entry;

class VectorKernels : public EveryTarget {
 protected:
  int uniform(int low, int high) {
    return low + static_cast<int>(random_() % static_cast<unsigned>(high - low + 1));
  }
  /// Values of the whole range, including its ends.
  std::vector<std::int16_t> values(int count, int low, int high) {
    std::vector<std::int16_t> out(static_cast<std::size_t>(count));
    for (std::int16_t& v : out) {
      const int dice = uniform(0, 9);
      v = static_cast<std::int16_t>(dice == 0 ? low : dice == 1 ? high : uniform(low, high));
    }
    return out;
  }

 private:
  std::minstd_rand random_{11};
};

TEST_P(VectorKernels, TheChosenTargetRuns) {
  EXPECT_EQ(std::string(target_name()), hwy::TargetName(GetParam()));
}

class VectorRectify : public VectorKernels {
 protected:
  static constexpr int kFrameWidth = 150;
  static constexpr int kFrameHeight = 40;
  static constexpr std::size_t kPage = 65536;  // of any processor

  void SetUp() override {
    VectorKernels::SetUp();
    // 64 readable bytes follow the last pixel and no more.
    constexpr std::size_t kUsed = std::size_t{kFrameWidth + 5} * kFrameHeight + 64;
    static_assert(kUsed <= kPage);
    void* const pages =
        ::mmap(nullptr, 2 * kPage, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    ASSERT_NE(pages, MAP_FAILED);
    pages_ = static_cast<std::uint8_t*>(pages);
    ASSERT_EQ(::mprotect(pages_ + kPage, kPage, PROT_NONE), 0);
    luma_ = {pages_ + kPage - kUsed, kUsed};
    for (std::uint8_t& v : luma_) {
      const int dice = uniform(0, 3);
      v = static_cast<std::uint8_t>(dice == 0 ? 0 : dice == 1 ? 255 : uniform(0, 255));
    }
  }
  void TearDown() override {
    ::munmap(pages_, 2 * kPage);
    VectorKernels::TearDown();
  }
  /// Checks one row of a map, in full and in every part, against the scalar kernel.
  void check(const std::vector<Entry>& entries) {
    const int width = static_cast<int>(entries.size());
    const RectifyTable table{kFrameWidth, kFrameHeight, width, 1, entries};
    RectifyPlan plan(table);
    const std::vector<std::int16_t> reference = values(padded(width), 0, 16320);
    const std::ptrdiff_t stride = kFrameWidth + uniform(0, 5);
    // The start is as far back as the frame's last pixel allows.
    const std::uint8_t* luma =
        luma_.data() + luma_.size() - 64 - kFrameWidth - stride * (kFrameHeight - 1);
    std::vector<std::int16_t> should(entries.size());
    kernels::rectify_difference_row(luma, stride, entries.data(), reference.data(), width,
                                    should.data());
    plan.set_stride(stride);
    const int groups = padded(width) / RectifyPlan::kGroup;
    const int first = uniform(0, groups - 1);
    for (const auto& [from, to] : {std::tuple(0, groups), std::tuple(first, groups),
                                   std::tuple(first, first + 1), std::tuple(0, first)}) {
      std::vector<std::int16_t> is(static_cast<std::size_t>(padded(width)), 12345);
      rectify_difference(plan, 0, from, to, luma, entries.data(), width, reference.data(),
                         is.data());
      for (int x = 0; x < width; ++x) {
        const auto i = static_cast<std::size_t>(x);
        const bool inside = x >= from * RectifyPlan::kGroup && x < to * RectifyPlan::kGroup;
        ASSERT_EQ(is[i], inside ? should[i] : 12345) << "pixel " << x << " of " << width;
      }
    }
  }
  /// Checks one row of a coarse map whose `decimation` rows of the table are `entries`.
  void check_mean(const std::vector<Entry>& entries, int decimation) {
    const int fine_width = static_cast<int>(entries.size()) / decimation;
    const int width = fine_width / decimation;
    const RectifyTable table{kFrameWidth, kFrameHeight, width, 1, entries, decimation};
    RectifyPlan plan(table);
    const std::vector<std::int16_t> reference = values(padded(fine_width), 0, 16320);
    const std::ptrdiff_t stride = kFrameWidth + uniform(0, 5);
    const std::uint8_t* luma = luma_.data() + uniform(0, 3);
    std::vector<std::int16_t> should(static_cast<std::size_t>(width));
    kernels::rectify_mean_difference_row(luma, stride, entries.data(), fine_width, decimation,
                                         reference.data(), width, should.data());
    plan.set_stride(stride);
    const int groups = padded(fine_width) / RectifyPlan::kGroup;
    const int first = uniform(0, groups - 1);
    for (const auto& [from, to] : {std::tuple(0, groups), std::tuple(first, groups),
                                   std::tuple(first, first + 1), std::tuple(0, first)}) {
      std::vector<std::int16_t> is(static_cast<std::size_t>(padded(fine_width)), 12345);
      rectify_mean_difference(plan, decimation, 0, from, to, luma, entries.data(), fine_width,
                              reference.data(), is.data());
      for (int x = 0; x < width; ++x) {
        const auto i = static_cast<std::size_t>(x);
        const int fine_x = x * decimation;
        const bool inside =
            fine_x >= from * RectifyPlan::kGroup && fine_x < to * RectifyPlan::kGroup;
        ASSERT_EQ(is[i], inside ? should[i] : 12345) << "pixel " << x << " of " << width;
      }
    }
  }
  Entry entry(double x, double y) {
    return {static_cast<std::int16_t>(std::clamp<int>(static_cast<int>(x), 0, kFrameWidth - 2)),
            static_cast<std::int16_t>(std::clamp<int>(static_cast<int>(y), 0, kFrameHeight - 2)),
            static_cast<std::uint8_t>(uniform(0, 128)), static_cast<std::uint8_t>(uniform(0, 128))};
  }

 private:
  std::uint8_t* pages_ = nullptr;
  std::span<std::uint8_t> luma_;
};

TEST_P(VectorRectify, LinesOfEverySlopeScaleAndLength) {
  for (int round = 0; round < 400; ++round) {
    const double step = uniform(-40, 250) / 100.0;  // 1.86 and more leave the groups' reach
    const double slope = uniform(-130, 130) / 100.0;
    const double x0 = uniform(0, kFrameWidth);
    const double y0 = uniform(-3, kFrameHeight + 3);
    std::vector<Entry> entries;
    for (int x = uniform(1, 110); x > 0; --x) {
      const auto i = static_cast<double>(entries.size());
      entries.push_back(entry(x0 + step * i, y0 + slope * i));
    }
    check(entries);
  }
}

TEST_P(VectorRectify, WildTables) {
  for (int round = 0; round < 50; ++round) {
    std::vector<Entry> entries(static_cast<std::size_t>(uniform(1, 70)));
    for (Entry& e : entries) e = entry(uniform(0, kFrameWidth), uniform(0, kFrameHeight));
    check(entries);
  }
}

TEST_P(VectorRectify, MeansOfLinesAndOfWildTables) {
  for (const int decimation : {2, 4}) {
    for (int round = 0; round < 200; ++round) {
      const double step = uniform(-40, 250) / 100.0;
      const double slope = uniform(-130, 130) / 100.0;
      const double x0 = uniform(0, kFrameWidth);
      const double y0 = uniform(-3, kFrameHeight + 3);
      const int width = decimation * uniform(1, 60);
      std::vector<Entry> entries;
      for (int y = 0; y < decimation; ++y) {
        for (int x = 0; x < width; ++x) entries.push_back(entry(x0 + step * x, y0 + slope * x + y));
      }
      if (round % 8 == 0) {
        for (Entry& e : entries) e = entry(uniform(0, kFrameWidth), uniform(0, kFrameHeight));
      }
      check_mean(entries, decimation);
    }
  }
}

TEST_P(VectorRectify, EveryWeight) {
  for (int fx = 0; fx <= 128; ++fx) {
    std::vector<Entry> entries;
    for (int fy = 0; fy <= 128; ++fy) {
      entries.push_back({static_cast<std::int16_t>(fy), 7, static_cast<std::uint8_t>(fx),
                         static_cast<std::uint8_t>(fy)});
    }
    check(entries);
  }
}

class VectorSmooth : public VectorKernels {
 protected:
  /// A kernel of non-negative taps that sum to one.
  std::vector<std::int16_t> taps(int radius) {
    std::vector<std::int16_t> out{0};
    int rest = kernels::kTapOne;
    for (int k = 1; k <= radius; ++k) {
      out.push_back(static_cast<std::int16_t>(uniform(0, rest / 2 / (radius - k + 1))));
      rest -= 2 * out.back();
    }
    out[0] = static_cast<std::int16_t>(rest);
    return out;
  }
};

TEST_P(VectorSmooth, BothDirectionsForEveryRadius) {
  for (int radius = 0; radius <= kernels::kMaxRadius; ++radius) {
    const std::vector<std::int16_t> kernel = taps(radius);
    const TapPairs pairs(kernel);
    ASSERT_GE(pairs.radius(), radius);
    const int width = padded(uniform(1, 130));
    const int blocks = width / kBlock;
    const int rows = 2 * pairs.count();
    const int stride = width + 2 * kernels::kMaxRadius;
    const std::vector<std::int16_t> image =
        values(rows * stride, -kernels::kSmoothable, kernels::kSmoothable);
    const auto row_of = [&](int y) {
      return image.data() + std::ptrdiff_t{y} * stride + kernels::kMaxRadius;
    };
    std::vector<std::vector<std::int16_t>> across;
    std::vector<std::vector<std::int16_t>> paired;
    for (int y = 0; y < rows; ++y) {
      across.emplace_back(static_cast<std::size_t>(width));
      kernels::smooth_horizontal_row(row_of(y), kernel, width, across.back().data());
      if (y % 2 == 0) continue;
      paired.emplace_back(static_cast<std::size_t>(2 * width));
      const int split = uniform(0, blocks);
      smooth_across(row_of(y - 1), row_of(y), pairs, 0, split, paired.back().data());
      smooth_across(row_of(y - 1), row_of(y), pairs, split, blocks, paired.back().data());
      for (int x = 0; x < width; ++x) {
        const int at = x / 32 * 64 + x % 2 * 32 + x % 32 / 2 * 2;
        ASSERT_EQ(paired.back().data()[at],
                  across[static_cast<std::size_t>(y - 1)][static_cast<std::size_t>(x)])
            << x;
        ASSERT_EQ(paired.back().data()[at + 1],
                  across[static_cast<std::size_t>(y)][static_cast<std::size_t>(x)])
            << x;
      }
    }
    std::vector<const std::int16_t*> pair_rows;
    pair_rows.reserve(paired.size());
    for (const auto& row : paired) pair_rows.push_back(row.data());
    std::vector<std::int16_t> a(static_cast<std::size_t>(width));
    std::vector<std::int16_t> b(a);
    smooth_down(pair_rows.data(), pairs, 0, blocks, a.data(), b.data());
    for (int i = 0; i < 2; ++i) {
      std::vector<const std::int16_t*> span;
      span.reserve(2 * kernel.size());
      for (int k = -radius; k <= radius; ++k) {
        span.push_back((across.begin() + pairs.radius() + i + k)->data());
      }
      std::vector<std::int16_t> should(a.size());
      kernels::smooth_vertical_row(span.data(), kernel, width, should.data());
      ASSERT_EQ(i == 0 ? a : b, should) << "radius " << radius << ", row " << i;
    }
  }
}

class VectorLut : public VectorKernels {
 protected:
  void check(int first_q6, int entries, int covered_q6, bool gain) {
    std::vector<std::int16_t> um = values(entries, -32767, 32767);
    um.push_back(kUntrusted);
    check({um.data(), first_q6, first_q6 + entries - 1, covered_q6}, gain);
  }
  void check(const kernels::LutView& lut, bool gain) {
    for (int width = 1; width < 140; width += uniform(1, 7)) {
      const int stride = padded(width) + uniform(0, 9);
      const std::vector<std::int16_t> difference = values(3 * stride, -32768, 32767);
      const std::vector<std::int16_t> gains = values(3 * stride, 0, 32767);
      std::vector<std::uint8_t> marks;
      marks.reserve(gains.size());
      for (const std::int16_t g : gains) marks.push_back(static_cast<std::uint8_t>(g == 0));
      std::vector<std::int16_t> should(3 * static_cast<std::size_t>(width) + 1, 77);
      std::vector<std::int16_t> is = should;
      int beyond = 0;
      for (std::ptrdiff_t y = 0; y < 3; ++y) {
        beyond += kernels::gain_lut_mask_row(
            difference.data() + y * stride, gain ? gains.data() + y * stride : nullptr,
            gain ? marks.data() + y * stride : nullptr, lut, width, should.data() + y * width);
      }
      const LutRows rows{difference.data(),
                         stride,
                         gain ? gains.data() : nullptr,
                         stride,
                         is.data(),
                         width,
                         width,
                         3};
      ASSERT_EQ(gain_lut_mask(rows, lut), beyond) << width;
      ASSERT_EQ(is, should) << width;
    }
  }
};

TEST_P(VectorLut, EveryWidthWithAndWithoutGain) {
  for (const bool gain : {false, true}) {
    check(-40 * 64, 150 * 64 + 1, 100 * 64, gain);
    check(-16320, 32641, 16320, gain);
    check(16319, 2, 16320, gain);
    check(-5, 1, -5, gain);
  }
}

TEST_P(VectorLut, KnotsGiveWhatTheirTableGives) {
  for (int round = 0; round < 30; ++round) {
    kernels::Knots knots;
    knots.step_bits = uniform(6, 7);
    for (std::size_t k = 0; k < knots.at_q3.size(); ++k) {
      const int at = k % 9 == 0 ? 32000 * uniform(-1, 1) : uniform(-15000, 15000);
      knots.at_q3[k] = static_cast<std::int16_t>(at);
      if (k == 0) continue;
      const int rise = std::clamp(at - knots.at_q3[k - 1], -32767, 32767);
      knots.at_q3[k] = static_cast<std::int16_t>(knots.at_q3[k - 1] + rise);
      knots.rise_q3[k - 1] = static_cast<std::int16_t>(rise);
    }
    const int most = 127 << knots.step_bits;
    const int places = uniform(0, 2) == 0 ? most : uniform(0, most);
    const int first_q6 = uniform(-16320, 16320 - places);
    std::vector<std::int16_t> um;
    for (int i = 0; i <= places; ++i) um.push_back(kernels::between(knots, i));
    um.push_back(kUntrusted);
    um.push_back(kUntrusted);
    const int covered_q6 = first_q6 + places;
    check({um.data(), first_q6, covered_q6 + 1, covered_q6, &knots}, true);
    check({um.data(), first_q6, covered_q6 + 1, covered_q6, &knots}, false);
  }
}

TEST_P(VectorLut, WritesOverItsOwnInput) {
  std::vector<std::int16_t> um = values(150 * 64 + 1, -32767, 32767);
  um.push_back(kUntrusted);
  const kernels::LutView lut{um.data(), -40 * 64, 110 * 64, 100 * 64};
  // Some are longer than the number of entries that are read at once.
  for (const int width : {1, 31, 32, 33, 100, 640, 641, 1400}) {
    const int stride = padded(width);
    std::vector<std::int16_t> rows = values(2 * stride, -32768, 32767);
    std::vector<std::int16_t> should = rows;
    int beyond = 0;
    for (std::ptrdiff_t y = 0; y < 2; ++y) {
      beyond += kernels::gain_lut_mask_row(rows.data() + y * stride, nullptr, nullptr, lut, width,
                                           should.data() + y * stride);
    }
    ASSERT_EQ(gain_lut_mask({rows.data(), stride, nullptr, 0, rows.data(), stride, width, 2}, lut),
              beyond);
    ASSERT_EQ(rows, should) << width;
  }
}

DTACT_EVERY_TARGET(VectorKernels);
DTACT_EVERY_TARGET(VectorRectify);
DTACT_EVERY_TARGET(VectorSmooth);
DTACT_EVERY_TARGET(VectorLut);

}  // namespace
}  // namespace dtact::recon::vec
