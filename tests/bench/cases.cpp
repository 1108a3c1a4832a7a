#include "tests/bench/cases.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <memory>
#include <stdexcept>
#include <utility>

#include "daemon/pipeline/depth/contact.hpp"
#include "daemon/pipeline/depth/uncertainty.hpp"
#include "daemon/pipeline/reference/cells.hpp"
#include "daemon/recon/kernels.hpp"
#include "daemon/recon/model.hpp"
#include "daemon/recon/reconstructor.hpp"
#include "daemon/recon/tile_readers.hpp"
#include "hal/luma/luma.hpp"
#include "hal/mjpeg/grey_decoder.hpp"
#include "tests/bench/opencv_pipeline.hpp"
#include "tests/bench/scene.hpp"
#include "tests/unit/recon/specification.hpp"

namespace dtact::bench {
namespace {

using Depth = std::vector<std::int16_t>;

/// Radius of the standard press with its bulge: the smallest round press that makes all tiles
/// active.
constexpr double kPressRadius = 380;

/// The inputs of all cases.
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

/// The other pipelines have no bulge and cut their bits earlier: they are compared where the press
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

/// Contact and expected error, as the daemon's frames carry them.
struct Told {
  pipeline::ContactSummary contact;
  double uncertainty_um = 0;
};

/// The daemon's work on a frame with a depth subscriber: find active tiles, reconstruct them, find
/// contact, state the uncertainty.
class DaemonFrame {
 public:
  explicit DaemonFrame(std::shared_ptr<const recon::Model> model)
      : model_(std::move(model)),
        reconstructor_(model_),
        cells_(recon::CellLattice(model_->rectify)),
        readers_(cells_.lattice(), model_->rectify, reconstructor_.radius()),
        tiles_(static_cast<std::size_t>(reconstructor_.grid().rows())),
        depth_(static_cast<std::size_t>(model_->rectify.width * model_->rectify.height)) {
    cells_.set_reference(model_->reference_q8);
  }

  void run(const std::uint8_t* luma, std::ptrdiff_t stride) {
    recon::DepthSums sums(rules());
    look(luma, stride);
    reconstructor_.run_active(luma, stride, tiles_, depth_, drawn_, nullptr, &sums);
    reported_ = tell(sums, contact_);
  }
  /// The same without contact and uncertainty.
  void run_bare(const std::uint8_t* luma, std::ptrdiff_t stride) {
    look(luma, stride);
    reconstructor_.run_active(luma, stride, tiles_, depth_, drawn_);
  }
  /// Empty, or the error of the last run() on that frame.
  [[nodiscard]] std::string wrong(const std::uint8_t* luma, std::ptrdiff_t stride) const {
    recon::Specification specification(*model_);
    Depth should = specification.run(luma, stride);
    recon::DepthSums sums(rules());
    for (int y = 0; y < grid().height; ++y) {
      std::int16_t* const row = should.data() + std::ptrdiff_t{y} * grid().width;
      for (int x = 0; x < grid().width; ++x) {
        if (!drawn(x, y)) row[x] = 0;
      }
    }
    std::string difference = compare(depth_, should);
    if (!difference.empty()) return difference;
    add_up(sums);
    pipeline::ContactDetector contact({});
    const Told is = reported_;
    const Told expected = tell(sums, contact);
    if (is.contact.area_mm2 != expected.contact.area_mm2 ||
        is.contact.x_mm != expected.contact.x_mm || is.contact.y_mm != expected.contact.y_mm ||
        is.contact.volume_mm3 != expected.contact.volume_mm3 ||
        is.contact.deepest_mm != expected.contact.deepest_mm ||
        is.contact.deepest_x_mm != expected.contact.deepest_x_mm ||
        is.contact.deepest_y_mm != expected.contact.deepest_y_mm) {
      return "another contact";
    }
    return is.uncertainty_um == expected.uncertainty_um ? "" : "another uncertainty";
  }
  [[nodiscard]] const recon::TileGrid& grid() const { return reconstructor_.grid(); }
  [[nodiscard]] const recon::TileRows& tiles() const { return drawn_.tiles; }
  [[nodiscard]] recon::FrameRegion region() const { return cells_.lattice().region(); }

 private:
  void look(const std::uint8_t* luma, std::ptrdiff_t stride) {
    (void)cells_.look({luma, kFrameWidth, kFrameHeight, stride});
    readers_.mark(cells_.active(), tiles_);
  }
  [[nodiscard]] recon::SumRules rules() const {
    recon::SumRules rules = contact_.sum_rules();
    rules.bend_reach = pipeline::bend_reach(model_->mm_per_px);
    rules.bend_from_um = rules.threshold_um;
    return rules;
  }
  [[nodiscard]] Told tell(const recon::DepthSums& sums, pipeline::ContactDetector& contact) const {
    constexpr double kLutUm = 20;
    return {contact.inspect(sums, grid().width, grid().height, model_->mm_per_px, {}),
            pipeline::uncertainty_at_um(kLutUm, pipeline::bend_um(sums, model_->mm_per_px),
                                        model_->rectify.decimation)};
  }
  [[nodiscard]] bool drawn(int x, int y) const {
    const auto row = static_cast<std::size_t>(y / recon::TileGrid::kRows);
    return (drawn_.tiles[row] >> (x / grid().tile_width()) & 1U) != 0;
  }
  /// Sums over the finished map, a pixel at a time.
  void add_up(recon::DepthSums& sums) const {
    const int reach = sums.rules.bend_reach;
    for (int y = 0; y < grid().height; ++y) {
      const std::int16_t* const row = depth_.data() + std::ptrdiff_t{y} * grid().width;
      const bool bends =
          y >= reach && y < grid().height - reach && (y - reach) % sums.rules.bend_step() == 0;
      for (int x = 0; x < grid().width; ++x) {
        if (!drawn(x, y)) continue;
        recon::kernels::sum_row(row, y, x, x + 1, sums);
        if (bends && x >= reach && x < grid().width - reach) {
          recon::kernels::bend_row(row, grid().width, x, x + 1, sums);
        }
      }
    }
  }

  std::shared_ptr<const recon::Model> model_;
  recon::Reconstructor reconstructor_;
  pipeline::Cells cells_;
  recon::TileReaders readers_;
  recon::TileRows tiles_;
  pipeline::ContactDetector contact_{{}};
  Depth depth_;
  recon::DrawnTiles drawn_;
  Told reported_;
};

/// Share of the map's pixels in the tiles: the tiles at its right edge are narrower.
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

/// One frame repeatedly. `everywhere`: all of its tiles must be active.
Case daemon_frame(const std::string& name, std::shared_ptr<const recon::Model> model, Image frame,
                  bool everywhere) {
  struct State {
    DaemonFrame daemon;
    Image frame;
  };
  auto state = std::make_shared<State>(State{DaemonFrame(std::move(model)), std::move(frame)});
  const auto once = [state] { state->daemon.run(state->frame.data(), kFrameWidth); };
  once();
  const double share = share_of(state->daemon.tiles(), state->daemon.grid());
  return {name, once,
          [state, share, everywhere] {
            if (everywhere && share < 1) return std::string("not all of the field is active");
            return state->daemon.wrong(state->frame.data(), kFrameWidth);
          },
          share};
}

Case full_field(const Inputs& in) { return daemon_frame("full", in.model, in.press, true); }

/// The whole map without contact and uncertainty.
Case bare(const Inputs& in) {
  auto daemon = std::make_shared<DaemonFrame>(in.model);
  return {"full-bare", [&in, daemon] { daemon->run_bare(in.press.data(), kFrameWidth); },
          [&in, daemon] {
            daemon->run(in.press.data(), kFrameWidth);
            return daemon->wrong(in.press.data(), kFrameWidth);
          }};
}

Case coarse(const Inputs& in, const std::string& name, int factor) {
  return daemon_frame(name,
                      std::make_shared<const recon::Model>(recon::decimate(*in.model, factor)),
                      in.press, true);
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
  auto state = std::make_shared<State>(OpenCvPipeline(in.lens, in.model->reference_q8, lut_mm_of()),
                                       cv::Mat());
  return {"opencv", [&in, state] { state->depth = state->pipeline.run(in.press); },
          [&in, state] { return compare_roughly(state->depth.ptr<float>(), in.specified); }};
}

/// From the payload to the daemon's results, or the decoding only. `decimation`: of the map, from
/// frames that are decoded at 1/`scale` of their size.
Case mjpeg(const Inputs& in, const std::string& name, bool reconstruct, int decimation = 1,
           int scale = 1) {
  struct State {
    hal::mjpeg::GreyDecoder decoder;
    hal::luma::LumaBuffer luma;
    DaemonFrame daemon;
    bool ok = true;
    State(const std::shared_ptr<const recon::Model>& model, int frame_scale)
        : decoder(kFrameWidth, kFrameHeight, frame_scale),
          luma(kFrameWidth / frame_scale, kFrameHeight / frame_scale),
          daemon(model) {
      const recon::FrameRegion read = daemon.region();
      decoder.set_crop({read.x, read.y, read.width, read.height});
    }
  };
  const recon::Model of = scale == 1 ? *in.model : recon::for_scaled_frames(*in.model, scale);
  auto state = std::make_shared<State>(
      std::make_shared<const recon::Model>(recon::decimate(of, decimation / scale)), scale);
  return {name,
          [&in, state, reconstruct] {
            const auto status =
                state->decoder.decode(in.jpeg, state->luma.data(), state->luma.stride());
            state->ok = status == hal::mjpeg::Status::ok && state->ok;
            if (reconstruct) state->daemon.run(state->luma.data(), state->luma.stride());
          },
          [state, reconstruct]() -> std::string {
            if (!state->ok) return "the decoder refuses the frame";
            if (!reconstruct) return {};
            return state->daemon.wrong(state->luma.data(), state->luma.stride());
          }};
}

using Maker = std::function<Case(const std::string& name, const Inputs&)>;

/// All cases, each made on request: counting instructions starts a process for a single case.
const std::vector<std::pair<std::string, Maker>>& makers() {
  static const auto the_makers = [] {
    std::vector<std::pair<std::string, Maker>> all{
        {"full", [](const auto&, const Inputs& in) { return full_field(in); }},
        {"full-bare", [](const auto&, const Inputs& in) { return bare(in); }},
        {"half", [](const auto& name, const Inputs& in) { return coarse(in, name, 2); }},
        {"quarter", [](const auto& name, const Inputs& in) { return coarse(in, name, 4); }},
        {"scalar", [](const auto&, const Inputs& in) { return scalar(in); }},
        {"opencv", [](const auto&, const Inputs& in) { return opencv(in); }},
        {"decode", [](const auto& name, const Inputs& in) { return mjpeg(in, name, false); }},
        {"decode+full", [](const auto& name, const Inputs& in) { return mjpeg(in, name, true); }}};
    for (const auto& [map, decimation] : {std::pair("half", 2), std::pair("quarter", 4)}) {
      for (const int scale : {1, decimation}) {
        all.emplace_back(
            fmt::format("decode{}+{}", scale == 1 ? "" : fmt::format("/{}", scale), map),
            [decimation, scale](const std::string& name, const Inputs& in) {
              return mjpeg(in, name, true, decimation, scale);
            });
      }
    }
    for (const int radius : {0, 40, 80, 120, 160, 190, 220, 260, 300, 340, 380, 450}) {
      // Only active tiles are computed.
      all.emplace_back(
          fmt::format("press:{}", radius), [radius](const std::string& name, const Inputs& in) {
            return daemon_frame(name, in.model, Inputs::with_padding(make_frame(radius, 2)), false);
          });
    }
    return all;
  }();
  return the_makers;
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

std::vector<float> lut_mm_of() {
  const recon::DepthLut& lut = inputs().model->lut;
  std::vector<float> mm;
  for (int level = 0; level < 256; ++level) {
    const int q6 = std::min(level * recon::kEntriesPerLevel, lut.covered_to_q6);
    mm.push_back(static_cast<float>(lut.um[static_cast<std::size_t>(q6 - lut.first_q6)]) / 1000);
  }
  return mm;
}

std::vector<std::string> case_names() {
  std::vector<std::string> names;
  for (const auto& [name, make] : makers()) names.push_back(name);
  return names;
}

Case make_case(const std::string& name) {
  for (const auto& [known, make] : makers()) {
    if (known == name) return make(name, inputs());
  }
  throw std::runtime_error("no case named " + name);
}

void export_inputs(const std::string& folder) {
  const Inputs& in = inputs();
  Image reference_image;
  for (const std::uint16_t q8 : in.model->reference_q8) {
    reference_image.push_back(static_cast<std::uint8_t>((q8 + 128) / 256));
  }
  Image frame = in.press;
  frame.resize(std::size_t{kFrameWidth} * kFrameHeight);
  write(folder + "/frame.raw", frame);
  write(folder + "/reference.raw", reference_image);
  write(folder + "/frame.jpg", in.jpeg);
  write(folder + "/map_x.f32", in.lens.x);
  write(folder + "/map_y.f32", in.lens.y);
  write(folder + "/list.f32", lut_mm_of());
  write(folder + "/depth.i16", in.specified);
}

}  // namespace dtact::bench
