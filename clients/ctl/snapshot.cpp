#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <memory>
#include <ostream>
#include <stdexcept>

#include "clients/common/depth_file.hpp"
#include "clients/ctl/json/json.hpp"
#include "clients/ctl/online.hpp"
#include "hal/base/atomic_file.hpp"
#include "hal/image/png.hpp"

namespace dtact::ctl {
namespace {

struct SnapshotOptions {
  std::string output;
  bool luma = false;
  double timeout_s = 5;
};

/// The map as a picture: the deeper, the lighter, from the shallowest pixel to the deepest; what is
/// not to be believed is orange. dtact-calibrate has colours and a legend.
std::string encode_grey_png(const cli::DepthImage& depth) {
  float low = 0;
  float high = 0.1F;
  for (const float mm : depth.mm) {
    if (std::isnan(mm)) continue;
    low = std::min(low, mm);
    high = std::max(high, mm);
  }
  image::Rgb8 picture{depth.width, depth.height, {}};
  picture.pixels.reserve(3 * depth.mm.size());
  for (const float mm : depth.mm) {
    if (std::isnan(mm)) {
      picture.pixels.insert(picture.pixels.end(), {230, 90, 0});
    } else {
      const auto grey = static_cast<std::uint8_t>(std::lround(255 * (mm - low) / (high - low)));
      picture.pixels.insert(picture.pixels.end(), 3, grey);
    }
  }
  return image::encode_png(picture);
}

/// The next frame that holds what is asked for.
client::Frame fetch(client::Client& client, const SnapshotOptions& options) {
  client::Subscription subscription;
  subscription.depth = options.luma ? client::Depth::none : client::Depth::delta_zstd;
  subscription.luma = options.luma ? client::Luma::grey8 : client::Luma::none;
  client.subscribe(subscription);
  const auto end = std::chrono::steady_clock::now() +
                   std::chrono::milliseconds(static_cast<std::int64_t>(options.timeout_s * 1e3));
  for (;;) {
    const auto left =
        std::chrono::ceil<std::chrono::milliseconds>(end - std::chrono::steady_clock::now());
    if (left.count() <= 0) break;
    auto message = client.next(left);
    if (!message.has_value()) break;
    auto* frame = std::get_if<client::Frame>(&*message);
    if (frame == nullptr) continue;
    if (options.luma ? frame->luma.has_value() : frame->depth.has_value()) {
      return std::move(*frame);
    }
  }
  const auto status = client.status();
  throw std::runtime_error(fmt::format("no {} came within {:g} s; the daemon's state is {}. {}",
                                       options.luma ? "image" : "depth", options.timeout_s,
                                       status.state, status.advice));
}

std::string encode(const client::Frame& frame, const SnapshotOptions& options) {
  if (options.luma) {
    return image::encode_png(
        image::Grey8{frame.luma->width, frame.luma->height, frame.luma->values});
  }
  const auto mm = frame.depth->millimetres();
  return cli::encoder_for(options.output, encode_grey_png)(
      {frame.depth->width, frame.depth->height, frame.depth->mm_per_px, mm});
}

void run_snapshot(const Context& context, const SnapshotOptions& options) {
  if (!options.luma) {
    (void)cli::encoder_for(options.output, encode_grey_png);
  } else if (std::filesystem::path(options.output).extension() != ".png") {
    throw CLI::ValidationError("-o " + options.output, "with --luma the name must end in .png");
  }
  client::Client client(context.target);
  const auto frame = fetch(client, options);
  base::write_file_atomically(options.output, encode(frame, options));
  if (context.json) {
    Json json;
    json.open('{').member("file", options.output).member("sequence", frame.sequence);
    json.member("monotonic_ns", frame.monotonic_ns).member("wall_ns", frame.wall_ns);
    json.member("touching", frame.contact.touching).member("area_mm2", frame.contact.area_mm2);
    json.member("deepest_mm", frame.contact.deepest_mm).member("health", frame.health);
    context.out << json.close('}').text() << '\n';
  } else {
    context.out << fmt::format(
        "{}: frame {}, deepest {:.3f} mm, contact {:.1f} mm2{}\n", options.output, frame.sequence,
        frame.contact.deepest_mm, frame.contact.area_mm2,
        frame.health.empty() ? "" : fmt::format(", {}", fmt::join(frame.health, ", ")));
  }
}

}  // namespace

void add_snapshot(CLI::App& app, Context& context) {
  auto* command = app.add_subcommand("snapshot", "Save one frame of the running daemon");
  const auto options = std::make_shared<SnapshotOptions>();
  command
      ->add_option(
          "-o,--output", options->output,
          "depth.npy (float32 mm, NaN where untrusted), depth.png (the deeper, the lighter) "
          "or depth.ply (points, mm); with --luma a .png")
      ->required();
  command->add_flag("--luma", options->luma, "The camera's grey image instead of the depth");
  command->add_option("--timeout", options->timeout_s, "Seconds to wait for a frame")
      ->capture_default_str()
      ->check(CLI::PositiveNumber);
  command->callback([&context, options] { run_snapshot(context, *options); });
}

}  // namespace dtact::ctl
