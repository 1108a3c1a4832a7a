#include "tests/bench/cases.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <memory>
#include <stdexcept>
#include <utility>

#include "daemon/pipeline/untouched/cells.hpp"
#include "daemon/recon/decimate.hpp"
#include "daemon/recon/reconstructor.hpp"
#include "daemon/recon/tile_readers.hpp"
#include "hal/luma/luma_buffer.hpp"
#include "hal/mjpeg/grey_decoder.hpp"
#include "tests/bench/opencv_pipeline.hpp"
#include "tests/bench/scene.hpp"
#include "tests/unit/recon/specification.hpp"

namespace dtact::bench {
namespace {

using Depth = std::vector<std::int16_t>;

constexpr double kPressRadius = 190;  ///< Changed area of the standard press: a third of the map.

/// What every case reads.
struct Inputs {
  LensMap lens = make_lens_map();
  std::shared_ptr<const recon::Model> model = std::make_shared<recon::Model>(make_model());
  Image press = with_padding(make_frame(kPressRadius, 1));
  std::vector<std::uint8_t> jpeg = make_jpeg(press);
  Depth specified;

  Inputs() {
    recon::Specification specification(*model);
    specified = specification.run(press.data(), kFrameWidth);
  }
  static Image with_padding(Image frame) {
    frame.resize(frame.size() + hal::kLumaPadding);
    return frame;
  }
};

std::string compare(const Depth& is, const Depth& should) {
  if (is.size() != should.size()) return "another size";
  for (std::size_t i = 0; i < is.size(); ++i) {
    if (is[i] != should[i]) {
      return fmt::format("pixel {} is {} and should be {}", i, is[i], should[i]);
    }
  }
  return {};
}

/// The other pipelines see no bulge and cut their bits earlier: they are compared where the press
/// is deeper than 0.3 mm, and must agree within 0.02 mm on average.
std::string compare_roughly(const float* mm, const Depth& um) {
  double sum = 0;
  int count = 0;
  for (std::size_t i = 0; i < um.size(); ++i) {
    if (um[i] < 300) continue;
    sum += std::abs(mm[i] - um[i] / 1000.0);
    ++count;
  }
  if (count < 1000) return "nothing is pressed";
  if (sum / count > 0.02) return fmt::format("{:.4f} mm apart on average", sum / count);
  return {};
}

Case full_field(const Inputs& in) {
  struct State {
    recon::Reconstructor reconstructor;
    Depth depth;
  };
  auto state = std::make_shared<State>(recon::Reconstructor(in.model), Depth(in.specified.size()));
  return {"full",
          [&in, state] { state->reconstructor.run(in.press.data(), kFrameWidth, state->depth); },
          [&in, state] { return compare(state->depth, in.specified); }};
}

Case coarse(const Inputs& in, const std::string& name, int factor) {
  struct State {
    std::shared_ptr<const recon::Model> model;
    recon::Reconstructor reconstructor;
    Depth depth;
  };
  const auto model = std::make_shared<const recon::Model>(recon::decimate(*in.model, factor));
  const auto pixels = static_cast<std::size_t>(model->rectify.width) *
                      static_cast<std::size_t>(model->rectify.height);
  auto state = std::make_shared<State>(State{model, recon::Reconstructor(model), Depth(pixels)});
  return {name,
          [&in, state] { state->reconstructor.run(in.press.data(), kFrameWidth, state->depth); },
          [&in, state] {
            recon::Specification specification(*state->model);
            return compare(state->depth, specification.run(in.press.data(), kFrameWidth));
          }};
}

Case scalar(const Inputs& in) {
  auto specification = std::make_shared<recon::Specification>(*in.model);
  auto depth = std::make_shared<Depth>();
  return {
      "scalar",
      [&in, specification, depth] { *depth = specification->run(in.press.data(), kFrameWidth); },
      [&in, depth] { return compare(*depth, in.specified); }};
}

Case opencv(const Inputs& in) {
  struct State {
    OpenCvPipeline pipeline;
    cv::Mat depth;
  };
  auto state = std::make_shared<State>(OpenCvPipeline(in.lens, in.model->reference_q8, list_mm()),
                                       cv::Mat());
  return {"opencv", [&in, state] { state->depth = state->pipeline.run(in.press); },
          [&in, state] { return compare_roughly(state->depth.ptr<float>(), in.specified); }};
}

/// Decoding alone, and from the payload to depth.
std::vector<Case> mjpeg(const Inputs& in) {
  struct State {
    hal::mjpeg::GreyDecoder decoder{kFrameWidth, kFrameHeight};
    hal::luma::LumaBuffer luma{kFrameWidth, kFrameHeight};
    recon::Reconstructor reconstructor;
    Depth depth;
    bool ok = true;
    explicit State(const Inputs& inputs)
        : reconstructor(inputs.model), depth(inputs.specified.size()) {
      const recon::FrameRegion read = reconstructor.region();
      decoder.set_crop({read.x, read.y, read.width, read.height});
    }
    void decode(const Inputs& inputs) {
      ok = decoder.decode(inputs.jpeg, luma.data(), luma.stride()) == hal::mjpeg::Status::ok && ok;
    }
  };
  auto state = std::make_shared<State>(in);
  return {{"decode", [&in, state] { state->decode(in); },
           [state] { return state->ok ? std::string() : "the decoder refuses the frame"; }},
          {"decode+full",
           [&in, state] {
             state->decode(in);
             state->reconstructor.run(state->luma.data(), state->luma.stride(), state->depth);
           },
           [state, &in] {
             recon::Specification specification(*in.model);
             return compare(state->depth,
                            specification.run(state->luma.data(), state->luma.stride()));
           }}};
}

/// Share of the map's pixels that lie in the tiles: the tiles at its right edge are narrower.
double share_of(const recon::TileRows& tiles, const recon::TileGrid& grid) {
  int pixels = 0;
  for (int row = 0; row < grid.rows(); ++row) {
    const int height = std::min(recon::TileGrid::kRows, grid.height - row * recon::TileGrid::kRows);
    recon::for_each_run(tiles[static_cast<std::size_t>(row)], [&](int first, int last) {
      pixels +=
          height * (std::min(last * grid.tile_width(), grid.width) - first * grid.tile_width());
    });
  }
  return static_cast<double>(pixels) / (grid.width * grid.height);
}

/// A press of some size where only what changed is computed.
Case active(const Inputs& in, const std::string& name, double radius_px) {
  struct State {
    Image frame;
    recon::Reconstructor reconstructor;
    pipeline::Cells cells;
    recon::TileReaders readers;
    recon::TileRows tiles;
    Depth depth;
    recon::DrawnTiles drawn;
  };
  recon::Reconstructor reconstructor(in.model);
  pipeline::Cells cells{recon::CellLattice(in.model->rectify)};
  cells.set_reference(in.model->reference_q8);
  recon::TileReaders readers(cells.lattice(), in.model->rectify, reconstructor.radius());
  recon::TileRows tiles(static_cast<std::size_t>(reconstructor.grid().rows()));
  auto state = std::make_shared<State>(State{Inputs::with_padding(make_frame(radius_px, 2)),
                                             std::move(reconstructor),
                                             std::move(cells),
                                             std::move(readers),
                                             std::move(tiles),
                                             Depth(in.specified.size()),
                                             {}});
  const auto once = [state] {
    (void)state->cells.look({state->frame.data(), kFrameWidth, kFrameHeight, kFrameWidth});
    state->readers.mark(state->cells.active(), state->tiles);
    state->reconstructor.run_active(state->frame.data(), kFrameWidth, state->tiles, state->depth,
                                    state->drawn);
  };
  once();
  return {name, once,
          [&in, state] {
            recon::Specification specification(*in.model);
            Depth should = specification.run(state->frame.data(), kFrameWidth);
            const recon::TileGrid& grid = state->reconstructor.grid();
            for (int y = 0; y < kMapSide; ++y) {
              for (int x = 0; x < kMapSide; ++x) {
                const auto row = static_cast<std::size_t>(y / recon::TileGrid::kRows);
                if ((state->drawn.tiles[row] >> (x / grid.tile_width()) & 1U) == 0) {
                  should[static_cast<std::size_t>(y) * kMapSide + static_cast<std::size_t>(x)] = 0;
                }
              }
            }
            return compare(state->depth, should);
          },
          share_of(state->drawn.tiles, state->reconstructor.grid())};
}

template <typename Value>
void write(const std::string& path, const std::vector<Value>& values) {
  std::ofstream file(path, std::ios::binary);
  file.write(reinterpret_cast<const char*>(values.data()),
             static_cast<std::streamsize>(values.size() * sizeof(Value)));
  if (!file) throw std::runtime_error(path + ": cannot be written");
}

const Inputs& inputs() {
  static const Inputs the_inputs;
  return the_inputs;
}

}  // namespace

std::vector<float> list_mm() {
  const recon::DepthList& list = inputs().model->list;
  std::vector<float> mm;
  for (int level = 0; level < 256; ++level) {
    const int q6 = std::min(level * recon::kEntriesPerLevel, list.covered_to_q6);
    mm.push_back(static_cast<float>(list.um[static_cast<std::size_t>(q6 - list.first_q6)]) / 1000);
  }
  return mm;
}

std::vector<Case> make_cases() {
  const Inputs& in = inputs();
  std::vector<Case> cases{full_field(in), coarse(in, "half", 2), coarse(in, "quarter", 4),
                          scalar(in), opencv(in)};
  for (Case& c : mjpeg(in)) cases.push_back(std::move(c));
  for (const int radius : {0, 40, 80, 120, 160, 190, 220, 260, 300, 340, 380, 450}) {
    cases.push_back(active(in, fmt::format("press:{}", radius), radius));
  }
  return cases;
}

void export_inputs(const std::string& folder) {
  const Inputs& in = inputs();
  Image untouched;
  for (const std::uint16_t q8 : in.model->reference_q8) {
    untouched.push_back(static_cast<std::uint8_t>((q8 + 128) / 256));
  }
  Image frame = in.press;
  frame.resize(std::size_t{kFrameWidth} * kFrameHeight);
  write(folder + "/frame.raw", frame);
  write(folder + "/reference.raw", untouched);
  write(folder + "/frame.jpg", in.jpeg);
  write(folder + "/map_x.f32", in.lens.x);
  write(folder + "/map_y.f32", in.lens.y);
  write(folder + "/list.f32", list_mm());
  write(folder + "/depth.i16", in.specified);
}

}  // namespace dtact::bench
