// The whole reconstruction against the scalar kernels, on every instruction set.
#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <random>
#include <vector>

#include "daemon/recon/model.hpp"
#include "daemon/recon/reconstructor.hpp"
#include "tests/unit/recon/every_target.hpp"
#include "tests/unit/recon/specification.hpp"

namespace dtact::recon {
namespace {

struct Shape {
  int width;
  int height;
  double smoothing_px;
};

class Equality : public EveryTarget {
 protected:
  int uniform(int low, int high) {
    return low + static_cast<int>(random_() % static_cast<unsigned>(high - low + 1));
  }
  /// A lens that bends rows and columns, a mask, and a reference that is not the calibration's. The
  /// LUT is read entry by entry or, at even widths, by knots.
  Model make_model(const Shape& shape, Method method) {
    Model model;
    model.method = method;
    RectifyTable& table = model.rectify;
    table = {shape.width + 40, shape.height + 20, shape.width, shape.height, {}};
    for (int y = 0; y < shape.height; ++y) {
      for (int x = 0; x < shape.width; ++x) {
        const double u = x - shape.width / 2.0;
        const double v = y - shape.height / 2.0;
        const double bend = 1 - 2e-6 * (u * u + v * v);
        const int sx =
            std::clamp(static_cast<int>(128 * (table.frame_width / 2.0 + u * bend + 0.05 * v)), 0,
                       128 * (table.frame_width - 1) - 1);
        const int sy =
            std::clamp(static_cast<int>(128 * (table.frame_height / 2.0 + v * bend - 0.04 * u)), 0,
                       128 * (table.frame_height - 1) - 1);
        table.entries.push_back(
            {static_cast<std::int16_t>(sx / 128), static_cast<std::int16_t>(sy / 128),
             static_cast<std::uint8_t>(sx % 128), static_cast<std::uint8_t>(sy % 128)});
      }
    }
    model.mm_per_px = 0.05;
    model.smoothing_px = shape.smoothing_px;
    model.lut = {-40 * 64, {}, -20 * 64, 90 * 64};
    for (int q6 = -40 * 64; q6 <= 110 * 64; ++q6) {
      model.lut.um.push_back(static_cast<std::int16_t>(q6 < 0                 ? q6 / 3
                                                       : shape.width % 2 == 0 ? q6 / 2
                                                                              : 2 * q6));
    }
    // The narrow one reaches 1 to 6 pixels; the wide one, on its coarse grid, 1 to 9.
    if (method == Method::lut) {
      model.scattering = Scattering{.narrow_mm = 0.012 + shape.smoothing_px * 0.008,
                                    .wide_mm = 0.21 + shape.smoothing_px * 0.03,
                                    .narrow_weight = 0.6};
      // Each LUT differs at every level.
      model.sharpened = {{.steps = 1, .lut = model.lut, .uncertainty = {}},
                         {.steps = 2, .lut = model.lut, .uncertainty = {}}};
      for (Model::Sharpened& sharpened : model.sharpened) {
        for (std::int16_t& um : sharpened.lut.um) {
          um = static_cast<std::int16_t>(um + sharpened.steps);
        }
      }
    }
    model.reference_q8 = reference(model);
    model.untrusted.resize(table.entries.size());
    for (std::uint8_t& mark : model.untrusted) {
      mark = static_cast<std::uint8_t>(uniform(0, 20) == 0);
    }
    return model;
  }
  std::vector<std::uint16_t> reference(const Model& model) {
    std::vector<std::uint16_t> q8;
    const int pixels = model.rectify.frame_width * model.rectify.frame_height;
    for (int i = 0; i < pixels; ++i) {
      const int dice = uniform(0, 30);
      q8.push_back(static_cast<std::uint16_t>(dice == 0   ? 0
                                              : dice == 1 ? 65280
                                                          : 40000 + uniform(-3000, 3000)));
    }
    return q8;
  }
  std::vector<std::uint8_t> frame(std::ptrdiff_t stride, int height) {
    std::vector<std::uint8_t> luma(static_cast<std::size_t>(stride * height) + 64);
    for (std::uint8_t& v : luma) {
      const int dice = uniform(0, 20);
      v = static_cast<std::uint8_t>(dice == 0 ? 0 : dice == 1 ? 255 : uniform(60, 220));
    }
    return luma;
  }
  void check(const Shape& shape, Method method, int factor = 1, int steps = 0) {
    const auto model = std::make_shared<const Model>(decimate(make_model(shape, method), factor));
    Reconstructor reconstructor(model, steps);
    Specification specification(*model, steps);
    std::vector<std::int16_t> depth(
        static_cast<std::size_t>(model->rectify.width * model->rectify.height));
    for (int round = 0; round < 3; ++round) {
      const std::ptrdiff_t stride = model->rectify.frame_width + uniform(0, 9);
      const std::vector<std::uint8_t> luma = frame(stride, model->rectify.frame_height);
      reconstructor.run(luma.data(), stride, depth);
      const std::vector<std::int16_t> should = specification.run(luma.data(), stride);
      for (std::size_t i = 0; i < depth.size(); ++i) {
        ASSERT_EQ(depth[i], should[i]) << "pixel " << i << " of " << shape.width << "x"
                                       << shape.height << ", sigma " << shape.smoothing_px;
      }
      ASSERT_EQ(reconstructor.beyond_pixels(), specification.beyond());
      const std::vector<std::uint16_t> next = reference(*model);
      reconstructor.set_reference(next);
      specification.set_reference(next);
    }
  }

 private:
  std::minstd_rand random_{5};
};

constexpr Shape kShapes[] = {{1, 1, 1},      {2, 3, 0},     {31, 17, 2},  {32, 16, 1},
                             {33, 15, 2},    {64, 47, 0.6}, {90, 33, 10}, {95, 64, 3.2},
                             {130, 70, 1.4}, {580, 40, 2}};

TEST_P(Equality, Lut) {
  for (const Shape& shape : kShapes) check(shape, Method::lut);
}

TEST_P(Equality, Published) {
  for (const Shape& shape : kShapes) check(shape, Method::published);
}

TEST_P(Equality, HalfAndQuarterResolution) {
  for (const int factor : {2, 4}) {
    for (const Shape& shape : kShapes) {
      if (shape.width < factor || shape.height < factor) continue;
      check(shape, Method::lut, factor);
      check(shape, Method::published, factor);
    }
  }
}

TEST_P(Equality, Sharpened) {
  for (const int steps : {1, 2}) {
    for (const Shape& shape : kShapes) check(shape, Method::lut, 1, steps);
    // The daemon's shapes.
    for (const Shape& shape : {Shape{581, 163, 2}, Shape{130, 70, 1.4}}) {
      check(shape, Method::lut, 4, steps);
    }
  }
}

DTACT_EVERY_TARGET(Equality);

}  // namespace
}  // namespace dtact::recon
